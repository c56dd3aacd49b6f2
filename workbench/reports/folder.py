"""A folder that is written whole or not at all, and never over somebody else's."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from workbench.errors import BadFile

SUMMARY = "summary.json"  # by which a folder of ours is known, and what in it is ours
MAKER = "workbench"


def refuse_foreign(folder: Path) -> None:
    """Raise BadFile if `folder` exists and is not one that we wrote, nor empty."""
    if folder.exists() and not folder.is_dir():
        raise BadFile(f"{folder} is a file, and a folder is to be written; choose another name")
    if folder.is_dir() and any(folder.iterdir()) and _summary(folder) is None:
        raise BadFile(
            f"{folder} exists and holds no {SUMMARY} of a report, so it is not overwritten; "
            "move it away or choose another folder"
        )


@contextmanager
def replacing_folder(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` that takes its place when the block ends without an error.

    Whatever interrupts the block, the previous folder stays as it was. Files in that folder
    which no report wrote move over to the new one. Raises BadFile if the place cannot be
    written, or holds a folder that is not ours.
    """
    folder = Path(folder).resolve()
    refuse_foreign(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
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
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _swap(fresh: Path, folder: Path) -> None:
    if not folder.exists():
        fresh.rename(folder)
        return
    ours = set((_summary(folder) or {}).get("files", ())) | {SUMMARY}
    previous = fresh.with_name(f"{fresh.name}.previous")
    folder.rename(previous)
    try:
        fresh.rename(folder)
    except BaseException:
        previous.rename(folder)
        raise
    for kept in previous.iterdir():
        if kept.name not in ours and not (folder / kept.name).exists():
            kept.rename(folder / kept.name)
    shutil.rmtree(previous, ignore_errors=True)


def _summary(folder: Path) -> dict[str, Any] | None:
    """What our summary in the folder says, if it holds one."""
    try:
        found = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and found.get("made_by") == MAKER else None


def _unwritable(folder: Path, error: OSError) -> BadFile:
    reason = error.strerror or str(error)
    return BadFile(f"cannot write {folder}: {reason}; choose a folder that you may write to")
