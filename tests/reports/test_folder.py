"""A folder is replaced whole or not at all, and only if it is ours."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from workbench.errors import BadFile
from workbench.reports.folder import refuse_foreign, replacing_folder


def write(folder: Path, page: str = "a page", *files: str) -> None:
    with replacing_folder(folder) as fresh:
        for name in ("index.html", *files):
            (fresh / name).write_text(page)
        summary = {"made_by": "workbench", "files": ["index.html", "summary.json", *files]}
        (fresh / "summary.json").write_text(json.dumps(summary))


def test_second_folder_replaces_the_first(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    write(folder, "first", "body.glb")
    (folder / "notes.txt").write_text("mine")
    write(folder, "second")
    assert {path.name for path in folder.iterdir()} == {"index.html", "summary.json", "notes.txt"}
    assert (folder / "index.html").read_text() == "second"
    assert (folder / "notes.txt").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("error", [RuntimeError("in the middle"), KeyboardInterrupt()])
def test_interrupted_folder_leaves_the_previous_one(tmp_path: Path, error: BaseException) -> None:
    folder = tmp_path / "run"
    write(folder, "first")
    with pytest.raises(type(error)), replacing_folder(folder) as fresh:  # noqa: PT012
        (fresh / "index.html").write_text("half")
        raise error
    assert (folder / "index.html").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_failed_rename_leaves_the_previous_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    write(folder, "first")
    rename = Path.rename

    def failing(self: Path, target: Path) -> Path:
        if Path(target) == folder and "previous" not in self.name:
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(BadFile, match="No space left"):
        write(folder, "second")
    assert (folder / "index.html").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("summary", [None, "{}", "not json", '{"made_by": "someone"}', "[1]"])
def test_folder_of_others_is_left_alone(tmp_path: Path, summary: str | None) -> None:
    folder = tmp_path / "thesis"
    folder.mkdir()
    (folder / "chapter1.tex").write_text("years of work")
    if summary is not None:
        (folder / "summary.json").write_text(summary)
    for attempt in (write, refuse_foreign):
        with pytest.raises(BadFile, match="not overwritten"):
            attempt(folder)
    assert (folder / "chapter1.tex").read_text() == "years of work"
    assert [path.name for path in tmp_path.iterdir()] == ["thesis"]


def test_unwritable_place_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(BadFile, match="choose"):
            write(place)


def test_a_link_stays_and_what_it_points_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "runs")
    for page in ("first", "second"):
        write(tmp_path / "link", page)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "runs" / "index.html").read_text() == page


KILLED = """
import os, signal, sys
from pathlib import Path
from workbench.reports import folder
swap = Path.rename
def rename(self, target):
    if self.name.startswith("."):  # the new one was to take its place
        os.kill(os.getpid(), signal.SIGKILL)
    return swap(self, target)
with folder.replacing_folder(Path(sys.argv[1])) as fresh:
    (fresh / "index.html").write_text("half")
    if sys.argv[2] == "writing":
        os.kill(os.getpid(), signal.SIGKILL)
    Path.rename = rename
"""


@pytest.mark.thorough
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
@pytest.mark.parametrize("during", ["writing", "swapping"])
def test_folder_after_a_killed_writer_loses_nothing(tmp_path: Path, during: str) -> None:
    folder = tmp_path / "run"
    write(folder, "first")
    (folder / "notes.txt").write_text("mine")
    killed = [sys.executable, "-c", KILLED, str(folder), during]
    assert subprocess.run(killed, timeout=60, check=False).returncode == -9
    assert folder.exists() == (during == "writing")
    assert len(list(tmp_path.iterdir())) == 2
    write(folder, "second")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert (folder / "index.html").read_text() == "second"
    assert (folder / "notes.txt").read_text() == "mine"


def test_a_report_about_another_file_is_not_overwritten(tmp_path: Path) -> None:
    folder = tmp_path / "kp"

    def report(source: str | None) -> None:
        with replacing_folder(folder, source) as fresh:
            about = {} if source is None else {"source": source}
            (fresh / "summary.json").write_text(json.dumps({"made_by": "workbench", **about}))

    report("/a/kp.json")
    report("/a/kp.json")
    for attempt in (report, lambda source: refuse_foreign(folder, source)):
        with pytest.raises(BadFile, match=r"the report of /a/kp\.json, not of /b/kp\.json.* --out"):
            attempt("/b/kp.json")
    with pytest.raises(BadFile, match="not of the workbench's own kp"):
        report("")
    report(None)  # whoever does not say what it is about is let through
    report("/b/kp.json")


@pytest.mark.skipif(os.name != "posix", reason="permissions")
def test_the_folder_can_be_read_by_those_who_may(tmp_path: Path) -> None:
    write(tmp_path / "run")
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "run").stat().st_mode & 0o777 == 0o777 & ~mask
