"""`workbench sliders`, as typed."""

from pathlib import Path

import pytest

from tests.cli.conftest import Run


@pytest.mark.thorough
def test_sliders_writes_a_page(workbench: Run) -> None:
    code, out, err = workbench("body", "sliders", "small", "--out", "here")
    assert code == 0, err
    assert Path("here/sliders-small.html").stat().st_size > 100_000
    assert "sliders-small.html" in out
