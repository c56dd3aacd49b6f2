"""A folder that is written whole or not at all, and never over somebody else's."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workbench.errors import BadFile
from workbench.reading.facts import json_in
from workbench.reports.page import as_json, versions
from workbench.writing import leftovers, temporary_prefix

SUMMARY = "summary.json"  # by which a folder of ours is known, and what in it is ours
MAKER = "workbench"
PREVIOUS = ".previous"
Content = str | Callable[[Path], object]  # a text, or a function that writes to a path


def refuse_foreign(folder: Path, source: str | None = None) -> None:
    """Raise BadFile if `folder` exists and is not one that we wrote, nor empty.

    It is also raised for a folder with a report about another source: `source` is the file that a
    report is about, or "" where there is none.
    """
    if folder.exists() and not folder.is_dir():
        raise BadFile(f"{folder} is a file, and a folder is to be written; choose another name")
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    summary = _summary(folder)
    if summary is None:
        raise BadFile(
            f"{folder} exists and holds no {SUMMARY} of a report, so it is not overwritten; "
            "move it away or choose another folder"
        )
    before = summary.get("source", source)  # a summary without one is not compared
    if source is not None and before != source:
        held, new = (of or f"the workbench's own {folder.name}" for of in (before, source))
        raise BadFile(
            f"{folder} holds the report of {held}, not of {new}, so it is not overwritten; "
            "choose another folder with --out"
        )


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, unless they exist. Raises BadFile."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadFile(
            f"cannot make the folder {folder}: {error.strerror}; choose another folder"
        ) from error


def own_folder(folder: Path, source: str) -> None:
    """Make a folder to which results are added one by one, unless it is there already.

    Raises BadFile as `refuse_foreign` does, and if it cannot be made.
    """
    refuse_foreign(folder, source)
    make_folder(folder)


def write_folder(
    folder: str | Path,
    source: str | None,
    contents: Mapping[str, Content],
    summary: Mapping[str, Any],
) -> Path:
    """Write a folder whole or not at all, and return its page, `index.html`.

    `contents` has for each file its text, or a function that writes it to a given path. The folder
    also gets SUMMARY, which holds the summary, the versions and the source from which the files
    were made, and their names. Raises BadFile as `replacing_folder` does.
    """
    target = Path(folder)
    with replacing_folder(target, source) as fresh:
        for name, content in contents.items():
            if isinstance(content, str):
                (fresh / name).write_text(content, encoding="utf-8")
            else:
                content(fresh / name)
        text = summary_text(source or "", summary, sorted([*contents, SUMMARY]))
        (fresh / SUMMARY).write_text(text, encoding="utf-8")
    return target / "index.html"


def summary_text(source: str, summary: Mapping[str, Any], files: Sequence[str]) -> str:
    """What is written into SUMMARY: the summary, the versions, and the names of our files."""
    origin = {"made_by": MAKER, "source": source}
    return as_json({**origin, **summary, "versions": versions(), "files": files})


@contextmanager
def replacing_folder(folder: Path, source: str | None = None) -> Iterator[Path]:
    """A new folder beside `folder` that takes its place when the block ends without an error.

    Whatever interrupts the block, the previous folder stays as it was. Files in that folder
    which no report wrote move over to the new one. Raises BadFile if the place cannot be
    written, or holds a folder that is not ours or about another `source`.
    """
    folder = Path(folder).resolve()
    try:
        _recover(folder)
        refuse_foreign(folder, source)
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(dir=folder.parent, prefix=temporary_prefix(folder)))
    except OSError as error:
        raise _unwritable(folder, error) from error
    try:
        mask = os.umask(0)
        os.umask(mask)
        fresh.chmod(0o777 & ~mask)  # mkdtemp is private to its owner
        yield fresh
        _swap(fresh, folder)
    except OSError as error:
        raise _unwritable(folder, error) from error
    except BadFile as error:  # of a file in it, whose name is one that nobody knows
        if not isinstance(error.__cause__, OSError):
            raise
        raise _unwritable(folder, error.__cause__) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _swap(fresh: Path, folder: Path) -> None:
    if not folder.exists():
        fresh.rename(folder)
        return
    previous = fresh.with_name(fresh.name + PREVIOUS)
    folder.rename(previous)
    try:
        fresh.rename(folder)
    except BaseException:
        if not folder.exists():
            previous.rename(folder)
        raise
    _take_over(previous, folder)


def _take_over(previous: Path, folder: Path) -> None:
    """Move what is not ours from the previous folder to its successor, and remove the rest."""
    files = (_summary(previous) or {}).get("files")
    names = files if isinstance(files, list) else []
    ours = {SUMMARY, *(name for name in names if isinstance(name, str))}
    for kept in previous.iterdir():
        if kept.name not in ours and not (folder / kept.name).exists():
            kept.rename(folder / kept.name)
    shutil.rmtree(previous, ignore_errors=True)


def _recover(folder: Path) -> None:
    """Tidy up after writers that were killed; the folder that one of them moved away comes back."""
    for left in leftovers(folder):
        if not left.name.endswith(PREVIOUS):
            shutil.rmtree(left, ignore_errors=True)
        elif folder.exists():
            _take_over(left, folder)
        else:
            left.rename(folder)


def _summary(folder: Path) -> dict[str, Any] | None:
    """What our summary in the folder says, if it holds one."""
    try:
        summary = json_in(folder / SUMMARY)
    except BadFile:
        return None
    return summary if isinstance(summary, dict) and summary.get("made_by") == MAKER else None


def _unwritable(folder: Path, error: OSError) -> BadFile:
    reason = error.strerror or str(error)
    return BadFile(f"cannot write {folder}: {reason}; choose a folder that you may write to")
