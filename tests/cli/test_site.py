"""`workbench site`: what it refuses; building one is tried in `tests/site`."""

from pathlib import Path

from tests.cli.conftest import Run


def test_nothing_of_somebody_elses_is_replaced(workbench: Run, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    code, _, err = workbench("site", str(tmp_path))
    assert code == 2
    assert "no site of ours" in err or "pip install" in err  # where the tools are missing
    assert (tmp_path / "thesis.tex").read_text() == "years of work"
