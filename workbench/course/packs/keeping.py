"""Keeping the keys as they are while answers run, which code in C may change unseen."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from workbench.course.packs.keys import KEYS
from workbench.writing import write_file

MARKED = "marked"  # the folder in the keys that holds what is marked already
CHANGED = (
    "the keys were changed while this file ran; they were written back as they were before, and "
    "the file earns no points: look at what it does"
)


@dataclass
class Kept:
    """What happened to the keys.

    Attributes:
        changed: the names of the files that were changed, added or removed, and written back.
    """

    changed: list[str] = field(default_factory=list)


@contextmanager
def kept(folder: Path) -> Iterator[Kept]:
    """Hold the keys of a folder in memory, and write back afterwards what is not the same any more.

    These are the keys, the published answers beside them, and what is marked already. `changed` is
    complete after the context, also if it is left by an error.
    """
    before, found = _read(folder), Kept()
    try:
        yield found
    finally:
        after = _read(folder)
        for path in after.keys() - before.keys():
            path.unlink()
        for path, data in before.items():
            if after.get(path) != data:
                path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                write_file(path, data)
        paths = before.keys() | after.keys()
        found.changed = sorted(one.name for one in paths if before.get(one) != after.get(one))


def _read(folder: Path) -> dict[Path, bytes]:
    paths = [folder / KEYS, *folder.glob("answer-*.py"), *folder.glob(f"{MARKED}/*.json")]
    found: dict[Path, bytes] = {}
    for path in paths:
        with suppress(OSError):
            found[path] = path.read_bytes()
    return found
