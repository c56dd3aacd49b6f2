"""A lecture in a folder of its own: listed, shown, run, handed out and checked like the others."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from workbench.cli.app import app
from workbench.cli.new import write_scaffold
from workbench.course.outline import lecture_named, own_lecture
from workbench.errors import BadFile, UnknownName


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    yield write_scaffold("lecture", "of_my_own")
    for name in [name for name in sys.modules if "of_my_own" in name or "another" in name]:
        del sys.modules[name]  # the next test has a folder of this name elsewhere


@pytest.mark.thorough
def test_own_lecture_is_taken_by_every_command(folder: Path) -> None:
    def typed(*arguments: str, code: int = 0) -> str:
        done = CliRunner().invoke(app, ["lecture", *arguments])
        assert done.exit_code == code, done.output
        return done.output

    name = str(folder)
    assert "One wrong measurement" in typed("list", name)
    assert f"workbench lecture start {name} FOLDER" in typed("show", name)
    assert "mean with a wrong one" in typed("run", name)
    assert (Path("runs") / folder.name / "figure-1.png").stat().st_size > 5_000
    assert f"workbench lecture check {name}" in typed("start", name, ".")
    said = typed("check", name, code=1)  # although a file of the folder's name is beside it
    assert said.count("not attempted") == 2
    assert "2 of 2 points" in typed("check", name, str(folder / "solutions.py"))


def test_folder_that_is_no_lecture_is_refused(folder: Path) -> None:
    with pytest.raises(UnknownName, match="no lecture is called '99'"):
        lecture_named("99")
    with pytest.raises(BadFile, match="give the number of a lecture"):
        lecture_named("nowhere")
    (folder / "checks.py").unlink()
    with pytest.raises(BadFile, match=r"it has no checks\.py"):
        lecture_named(str(folder))
    other = write_scaffold("lecture", "another")
    (other / "outline.py").write_text("LECTURE = 1")
    with pytest.raises(BadFile, match="must define LECTURE"):
        own_lecture(other)
    taken = write_scaffold("lecture", "third").rename("lec02_rotations")
    with pytest.raises(BadFile, match="the course has a lecture of this name"):
        own_lecture(taken)
