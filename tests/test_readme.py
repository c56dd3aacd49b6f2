"""The README's Python block prints what the README says that it prints."""

import re
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text()


@pytest.mark.browser
def test_the_block_prints_its_output(capsys: pytest.CaptureFixture[str]) -> None:
    block, shown = re.search(r"```python\n(.*?)```\n\n```\n(.*?)```", README, re.S).groups()
    exec(compile(block, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    # the dropped singular value is rounding noise: compare it by size alone
    noise = re.compile(r"the next \d(\.\d+)?e-\d\d")
    assert noise.sub("the next ~0", printed) == noise.sub("the next ~0", shown)


def test_every_link_leads_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (Path(__file__).parents[1] / target).exists(), target
