"""Pickles loaded as bodies in a process of their own."""

from collections.abc import Iterator
from pathlib import Path

from tests.hardening.within_limits import Reader, reader

SECONDS, MEGABYTES = 2.0, 500  # that any pickle may take


def loading() -> Iterator[Reader]:
    """What loads a body, for a fixture."""
    yield from reader("workbench.bodies.catalogue:load_body", SECONDS, MEGABYTES)


def refused(bodies: Reader, folder: Path, file: bytes) -> str:
    """The sentence with which a pickle is refused as a body."""
    (folder / "model.pkl").write_bytes(file)
    return bodies.refusal(folder / "model.pkl")
