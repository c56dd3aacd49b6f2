"""The how-to pages: their code prints what they say, and their commands work as written."""

import re
import shlex
from pathlib import Path

import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.tiers import few
from workbench.experiments import find

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "howto").glob("*.md"))
EACH = pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```\n(.*?)```)?", re.S)
COMMANDS = re.compile(r"^```\n(workbench .*?)```", re.S | re.M)


@EACH
def test_code_of_a_page_prints_what_it_says(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": page.stem}
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert len(blocks) >= 2
    for code, shown in blocks:
        exec(compile(code, page.name, "exec", dont_inherit=True), names)
        assert capsys.readouterr().out == shown
    assert any(shown for _, shown in blocks)


def commands(page: Path) -> list[list[str]]:
    """What the first block of commands tells to type: `new`, and then what takes the file."""
    (typed,) = COMMANDS.findall(page.read_text(encoding="utf-8"))
    found = [shlex.split(line)[1:] for line in typed.splitlines()]
    assert [command[0] for command in found] == ["new", "run", "diagnose"]
    return found


@pytest.mark.thorough
@EACH
def test_commands_of_a_page_take_its_file(page: Path, workbench: Run) -> None:
    for command in commands(page):
        code, out, err = workbench(*command)
        assert code == 0, out + err


@pytest.mark.parametrize("page", few(PAGES, 0), ids=lambda path: path.stem)
def test_file_of_a_page_is_solved_without_warnings(
    page: Path, workbench: Run, tmp_path: Path
) -> None:
    new, *others = commands(page)
    assert workbench(*new)[0] == 0
    (path,) = tmp_path.glob("*.py")
    assert all(path.name in command for command in others)
    setup = find(str(path)).setup()
    solution = wb.solve(setup.problem, setup.start)
    assert solution.status is wb.Status.CONVERGED
    values = setup.start | solution.values
    assert not wb.diagnose(setup.problem, values, priors=setup.priors).warnings
    assert wb.sample(setup.problem, values, setup.problem.free.spelled()[:1]).usable


def test_pages_are_linked_and_their_links_lead_somewhere() -> None:
    for page in PAGES:
        link = f"howto/{page.name}"
        for name in ("README.md", "CONTRIBUTING.md"):
            assert link in (ROOT / name).read_text(encoding="utf-8"), (name, link)
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), target
