"""Registrations: meshes of one topology, of people in poses, read a few at a time."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from workbench.errors import BadArgument

Array = NDArray[np.float64]
Index = NDArray[np.int64]
FARTHEST = 1e6  # m: numbers beyond are no metres, and sums of their powers may overflow
HELD_BYTES, HELD_EACH = 2**29, 32  # of registrations in memory; of a vertex, and its trust
FEWEST = 64  # registrations in a piece: each reads and writes all posedirs once
HELD_BACK = 5  # one subject of so many, and at least one, where something is chosen
PIECE_BYTES = 2**23  # of a piece's largest array, (c, N, 3, 3): what a pass keeps in memory


@dataclass(frozen=True, eq=False)
class Batch:
    """c registrations in a row."""

    some: slice  # which
    subject: Index  # (c,): whose
    vertices: Array  # (c, N, 3) m
    seen: Array  # (c, N): how far each vertex is trusted, from 0 (missing) to 1


class Registrations(Protocol):
    """A source of registrations, in a fixed order; subjects are numbered from 0."""

    @property
    def subject(self) -> Index:
        """Whose each is, (J,)."""

    @property
    def n_vertices(self) -> int:
        """N."""

    def read(self, some: slice) -> Batch:
        """Those in a row."""


@dataclass(frozen=True, eq=False)
class InMemory:
    """Registrations as arrays."""

    vertices: Array  # (J, N, 3) m
    subject: Index  # (J,)
    seen: Array | None = None  # (J, N), from 0 to 1; None: every vertex is trusted

    @property
    def n_vertices(self) -> int:
        """N."""
        return int(self.vertices.shape[1])

    def read(self, some: slice) -> Batch:
        """Views and copies of the arrays."""
        vertices = np.asarray(self.vertices[some], dtype=np.float64)
        seen = np.ones(vertices.shape[:2]) if self.seen is None else self.seen[some].astype(float)
        return Batch(some, self.subject[some], vertices, seen)


@dataclass(frozen=True, eq=False)
class Picked:
    """Some registrations of a source, in an order of their own; subjects keep their numbers."""

    of: Registrations
    rows: Index

    @property
    def subject(self) -> Index:
        """Whose each is."""
        return self.of.subject[self.rows]

    @property
    def n_vertices(self) -> int:
        """N."""
        return self.of.n_vertices

    def read(self, some: slice) -> Batch:
        """One by one."""
        each = [self.of.read(slice(row, row + 1)) for row in self.rows[some].tolist()]
        vertices, seen = (
            np.concatenate([getattr(batch, name) for batch in each])
            for name in ("vertices", "seen")
        )
        return Batch(some, self.subject[some], vertices, seen)


def kept_and_held_back(subject: Index) -> tuple[Index, Index]:
    """Rows of registrations (J,): of most subjects, and of the last fifth of them, at least one.

    Where all are of one subject, the last fifth of his registrations. Raises BadArgument if there
    are not two.
    """
    if len(subject) < 2:
        raise BadArgument("of fewer than two registrations none can be held back; add some")
    who, apart = np.unique(subject, return_inverse=True)
    if len(who) == 1:
        apart = np.arange(len(subject))
    n = int(apart.max()) + 1
    back = apart >= n - max(1, n // HELD_BACK)
    return np.flatnonzero(~back), np.flatnonzero(back)


def held(registrations: Registrations) -> Registrations:
    """In memory where they are few enough: files take longer to read than a pass to compute."""
    J, N = len(registrations.subject), registrations.n_vertices
    if J * N * HELD_EACH > HELD_BYTES:
        return registrations
    read = list(batches(registrations))
    vertices, seen = (
        np.concatenate([getattr(batch, name) for batch in read]) for name in ("vertices", "seen")
    )
    return InMemory(vertices, registrations.subject, seen)


def batches(registrations: Registrations) -> Iterator[Batch]:
    """All of them once, as many at a time as memory likes."""
    for some in pieces(registrations):
        yield registrations.read(some)


def pieces(registrations: Registrations) -> list[slice]:
    """The rows of each batch."""
    J = len(registrations.subject)
    step = max(FEWEST, PIECE_BYTES // (72 * registrations.n_vertices))
    return [slice(first, min(first + step, J)) for first in range(0, J, step)]
