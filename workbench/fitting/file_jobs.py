"""What jobs on files of the user have in common: names that differ, and reasons of failures."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.errors import BadArgument, WorkbenchError, cut
from workbench.interrupts import caused_by

LOG = logging.getLogger(__name__)
LONGEST = 500  # letters of the reason of a failure


@dataclass(frozen=True)
class FileJob:
    """A file to be worked on, and a name for it."""

    name: str
    path: Path


@dataclass(frozen=True)
class FailedFile:
    """A file with which the work failed, and why, in a sentence."""

    job: FileJob
    reason: str


def check_names_differ(files: Sequence[Path], names: Sequence[str], work: str) -> None:
    """Raise BadArgument if two files have the same name, also where capitals do not count.

    `work` says what can be done with one after the other: `register them`.
    """
    folded = [name.casefold() for name in names]
    for path, name in zip(files, folded, strict=True):
        if folded.count(name) > 1:
            same = [str(p) for p, n in zip(files, folded, strict=True) if n == name]
            raise BadArgument(
                f"{' and '.join(same)} have the same name, and results are stored under it; "
                f"rename {path.name}, or {work} one after the other"
            )


def reason_of(error: Exception, path: Path, work: str) -> str:
    """Why the work on a file failed, in a sentence, so that others can go on.

    `work` says what was to be done: `register`. An error that nobody foresaw is logged with its
    traceback. Raises KeyboardInterrupt if that is what caused the error.
    """
    if isinstance(error, WorkbenchError):
        return cut(error, LONGEST)
    if isinstance(error, MemoryError):
        return f"there is not enough memory to {work} {path}"
    if caused_by(error, KeyboardInterrupt):
        raise KeyboardInterrupt from error
    LOG.warning("could not %s %s", work, path, exc_info=error)
    return cut(f"an unforeseen error, {type(error).__name__}: {error}", LONGEST)
