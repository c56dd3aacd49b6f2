"""The course for JupyterLite: its notebooks, and what is said where it cannot be built."""

from pathlib import Path

import pytest

from builder import lite
from workbench.course.outline import lecture


def test_a_notebook_installs_what_a_browser_needs_before_anything_runs() -> None:
    for name in ("jupytext", "nbformat"):
        pytest.importorskip(name)
    made = lite.for_browsers(lecture(2))
    code = [cell for cell in made.cells if cell.cell_type == "code"]
    compile(code[0].source, "cell", "exec", flags=0x2000)  # with await at its top
    assert "piplite.install('smpl-workbench', deps=False)" in code[0].source
    assert "'casadi'" in code[0].source
    assert all("piplite" not in cell.source for cell in code[1:])


def test_what_is_missing_is_told_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, wheel = tmp_path / "out", tmp_path / "one.whl"
    assert lite.main([str(out), "--wheel", str(wheel)]) == 2
    assert "is no wheel; build one with: pip wheel" in capsys.readouterr().err
    wheel.touch()
    monkeypatch.setattr(lite, "NEEDED", ("jupyterlite_of_nobody",))
    assert lite.main([str(out), "--wheel", str(wheel)]) == 2
    assert "pip install jupyterlite-of-nobody" in capsys.readouterr().err
    assert not out.exists()
