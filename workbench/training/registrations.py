"""Registrations: meshes of one topology, of people in poses, read a few at a time."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np

from workbench.arrays import Array, Index
from workbench.environment import in_browser
from workbench.errors import BadArgument, some_of

Item = TypeVar("Item")
Sum = TypeVar("Sum")
FARTHEST = 1e6  # m: larger numbers are no metres, and sums of their powers may overflow
IN_MEMORY_BYTES, BYTES_PER_VERTEX = 2**29, 32  # registrations of up to so many are read once
FEWEST_IN_PIECE = 64  # registrations in a piece: each piece reads and writes all posedirs once
PIECE_BYTES = 2**23  # of a piece's largest array, (c, N, 3, 3): what a pass keeps in memory


@dataclass(frozen=True, eq=False)
class Batch:
    """c consecutive registrations, read at once.

    Attributes:
        some: their rows among all registrations.
        subject: (c,) the number of each registration's subject.
        vertices: (c, N, 3) in metres.
        confidence: (c, N) how far each vertex is trusted, from 0 (missing) to 1; or (c, N, 3, 3)
            symmetric matrices with eigenvalues from 0 to 1, where that depends on the direction.
    """

    some: slice
    subject: Index
    vertices: Array
    confidence: Array

    @property
    def trust(self) -> Array:
        """How far each vertex is trusted, (c, N); the mean of all directions where they differ."""
        C = self.confidence
        return C if C.ndim == 2 else np.trace(C, axis1=2, axis2=3) / 3


class Registrations(Protocol):
    """A source of registrations in a fixed order, such as InMemory or a folder of meshes.

    A registration is a mesh of one topology, N vertices in metres, of a known subject.
    """

    @property
    def subject(self) -> Index:
        """The number of each registration's subject, (J,), counted from 0."""

    @property
    def n_vertices(self) -> int:
        """The number of vertices of each mesh, N."""

    def read(self, some: slice) -> Batch:
        """The registrations of these rows."""


@dataclass(frozen=True, eq=False)
class InMemory:
    """Registrations as arrays.

    Attributes:
        vertices: (J, N, 3) in metres.
        subject: (J,) the number of each registration's subject.
        confidence: (J, N) or (J, N, 3, 3) from 0 to 1, as in a Batch; None trusts every vertex.
    """

    vertices: Array
    subject: Index
    confidence: Array | None = None

    @property
    def n_vertices(self) -> int:
        """The number of vertices of each mesh, N."""
        return int(self.vertices.shape[1])

    def read(self, some: slice) -> Batch:
        """The registrations of these rows, converted to float64 where they are something else."""
        vertices = np.asarray(self.vertices[some], dtype=np.float64)
        C = self.confidence
        confidence = np.ones(vertices.shape[:2]) if C is None else C[some].astype(np.float64)
        return Batch(some, self.subject[some], vertices, confidence)


@dataclass(frozen=True, eq=False)
class RegistrationSubset:
    """Some registrations of a source, some of their vertices, or both; subjects keep their numbers.

    Attributes:
        source: the registrations that are chosen from.
        rows: the chosen rows of the source, in any order; None for all.
        vertices: (n,) the numbers of the chosen vertices; None for all.
    """

    source: Registrations
    rows: Index | None = None
    vertices: Index | None = None

    @property
    def subject(self) -> Index:
        """The number of each registration's subject, (J,)."""
        return self.source.subject if self.rows is None else self.source.subject[self.rows]

    @property
    def n_vertices(self) -> int:
        """The number of vertices of each mesh."""
        return self.source.n_vertices if self.vertices is None else len(self.vertices)

    def read(self, some: slice) -> Batch:
        """The registrations of these rows of the subset, chosen rows one by one.

        Raises BadArgument for one of which no chosen vertex is visible.
        """
        if self.rows is None:
            batch = self.source.read(some)
        else:
            each = (self.source.read(slice(row, row + 1)) for row in self.rows[some].tolist())
            batch = replace(_joined(each), some=some)
        if self.vertices is None:
            return batch
        confidence = batch.confidence[:, self.vertices]
        for j in np.flatnonzero(~confidence.reshape(len(confidence), -1).any(axis=1)):
            raise BadArgument(
                f"registration {batch.some.start + j} shows so little of its mesh that none of "
                f"{self.n_vertices} vertices spread over it is seen; leave it out"
            )
        return replace(batch, vertices=batch.vertices[:, self.vertices], confidence=confidence)


def check_registrations(registrations: Registrations, n_vertices: int) -> None:
    """Raise BadArgument unless meshes have N vertices, and subjects the numbers 0 to S - 1.

    A number that no registration has would be a person of whom nothing is known.
    """
    if registrations.n_vertices != n_vertices:
        raise BadArgument(
            f"registrations have {registrations.n_vertices} vertices, but the template has "
            f"{n_vertices}; give meshes of its topology"
        )
    numbers = np.unique(registrations.subject).tolist()
    if not numbers or numbers != list(range(len(numbers))):
        raise BadArgument(
            f"subjects must be numbered from 0 without gaps, got {some_of([*map(str, numbers)])}; "
            "np.unique(subject, return_inverse=True)[1] numbers them"
        )


def in_memory(registrations: Registrations) -> Registrations:
    """The registrations read into memory if they are few enough: reading files takes longer than
    a pass over them.
    """
    J, N = len(registrations.subject), registrations.n_vertices
    if J * N * BYTES_PER_VERTEX > IN_MEMORY_BYTES:
        return registrations
    every = _joined(batches(registrations))
    return InMemory(every.vertices, registrations.subject, every.confidence)


def batches(registrations: Registrations) -> Iterator[Batch]:
    """All registrations once, as many at a time as fit into memory easily."""
    for some in pieces(registrations):
        yield registrations.read(some)


def pieces(registrations: Registrations) -> list[slice]:
    """The rows of each batch."""
    step = max(FEWEST_IN_PIECE, PIECE_BYTES // (72 * registrations.n_vertices))
    return rows_of_jobs(len(registrations.subject), step)


def rows_of_jobs(count: int, size: int) -> list[slice]:
    """The rows from 0 to `count` in slices of at most `size`."""
    return [slice(first, min(first + size, count)) for first in range(0, count, size)]


def over_halves(work: Callable[[Sequence[Item]], Sum], items: Sequence[Item]) -> list[Sum]:
    """The results of a function for each half of the items, on two threads where there are any.

    Each thread adds up its half in order, and the two sums are added at the end, so that the result
    does not depend on which thread is faster. A single item is not divided.
    """
    middle = len(items) // 2
    halves = [items[:middle], items[middle:]] if middle else [items]
    if in_browser():
        return [work(half) for half in halves]
    with ThreadPoolExecutor() as threads:
        return list(threads.map(work, halves))


def _joined(read: Iterator[Batch]) -> Batch:
    each = list(read)
    subject, vertices, confidence = (
        np.concatenate([getattr(batch, name) for batch in each])
        for name in ("subject", "vertices", "confidence")
    )
    return Batch(slice(0, len(subject)), subject, vertices, confidence)
