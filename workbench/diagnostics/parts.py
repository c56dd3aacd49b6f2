"""A sparse Jacobian taken apart: unknowns that few others meet, and those that all of them share.

Where the unknowns that meet most others are left out, the rest of a large problem often falls into
small parts that no row ties together: the vertices of a training beside the poses, the points of a
bundle adjustment beside the cameras. The unknowns of each part can then be eliminated by
themselves, see `Elimination`. A few long rows that do tie parts together, such as those that keep
a joint at the middle of many vertices, are set aside and added afterwards, see `TiedElimination`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index, Mask
from workbench.diagnostics.frame_rows import in_columns, largest_singular_value, triangle
from workbench.problem import Linearization
from workbench.problem.sparsity import tied_columns
from workbench.problem.storage import by_nonzeros

CHEAPER = 0.1  # of the work of a dense factorisation: above, taking apart is not worth it
TRIES = 16  # ways to tell shared unknowns from the others
TIES = 100  # rows that are set aside at the most
CUTS = 3  # lengths of rows from which on they are set aside, in different tries
PAIRS = 1e8  # of unknowns in rows of J: with more, finding parts would take seconds
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Parts:
    """A Jacobian in columns of length 1, and the parts into which it falls.

    Attributes:
        shape: the numbers of rows and columns, (m, n).
        lengths: (n,) the lengths of the columns before; 1 where a column is zero.
        own: the places of the unknowns of each part.
        shared: (b,) the places of the unknowns that several parts share.
        triangles: for each part R of its rows by QR, in the columns (own, shared).
        rest: the rows that read only shared unknowns; all other rows are empty here.
        ties: (q, n) the rows that were set aside.
        tie_rows: (q,) the places of these rows.
        tolerance: the size below which a singular value counts as zero.
    """

    shape: tuple[int, int]
    lengths: Array
    own: tuple[Index, ...]
    shared: Index
    triangles: tuple[Array, ...]
    rest: csr_array
    ties: csr_array
    tie_rows: Index
    tolerance: float

    @property
    def count(self) -> int:
        """The number of parts."""
        return len(self.own)

    @staticmethod
    def of(here: Linearization) -> "Parts | None":
        """The parts of a Jacobian; None if it is dense, or its parts are not small enough."""
        if isinstance(here.jacobian, np.ndarray):
            return None
        J = by_nonzeros(here.jacobian)
        divided = _divided(J)
        if divided is None:
            return None
        own, shared, tie = divided
        lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
        unit = csr_array(J @ _diagonal(1 / lengths))
        part_of = np.full(J.shape[1], -1)
        for k, places in enumerate(own):
            part_of[places] = k
        tolerance = EPS * max(J.shape) * max(largest_singular_value(unit), 1.0)
        ties = csr_array(unit[tie])
        unit = csr_array(_diagonal((~tie).astype(float)) @ unit)
        unit.eliminate_zeros()
        row, column = unit.nonzero()
        of_row = np.full(J.shape[0], -1)
        np.maximum.at(of_row, row, part_of[column])
        place, triangles = np.full(J.shape[1], -1), []
        order = np.argsort(of_row, kind="stable")
        starts = np.searchsorted(of_row[order], np.arange(len(own) + 1))
        for k, places in enumerate(own):
            columns = np.concatenate([places, shared])
            place[columns] = np.arange(len(columns))
            rows = csr_array(unit[order[starts[k] : starts[k + 1]]])
            triangles.append(triangle(in_columns(rows, place, len(columns))))
        keep = csr_array(_diagonal((of_row < 0).astype(float)) @ unit)
        keep.eliminate_zeros()
        return Parts(
            J.shape,
            lengths,
            own,
            shared,
            tuple(triangles),
            keep,
            ties,
            np.flatnonzero(tie),
            tolerance,
        )


def _divided(J: csc_array) -> tuple[tuple[Index, ...], Index, Mask] | None:
    """The unknowns of each part, the shared ones, and which rows are set aside (m,), where that
    saves the most work.

    The unknowns that meet most others in rows of J are shared, and the longest rows are set aside.
    """
    m, n = J.shape
    in_row = np.bincount(J.indices, minlength=m)
    if float(np.sum(in_row.astype(float) ** 2)) > PAIRS:
        return None
    pattern = csr_array((np.ones(J.nnz, dtype=np.int32), J.indices, J.indptr), shape=(n, m)).T
    least, best = CHEAPER * float(n) ** 3, None
    for tie in _ties(in_row):
        kept = csc_array(_diagonal((~tie).astype(float)) @ pattern)
        kept.eliminate_zeros()
        found = _split(kept, least / (2 if tie.any() else 1))
        if found is not None:
            work, own = found
            least, best = work, (own, np.setdiff1d(np.arange(n), np.concatenate(own)), tie)
    return best


def _ties(in_row: Index) -> Iterator[Mask]:
    """Which rows (m,) may be set aside: none, or the longest, TIES of them at the most."""
    yield np.zeros(len(in_row), dtype=bool)
    for longest in np.unique(in_row)[:0:-1][:CUTS]:
        tie = in_row >= longest
        if np.count_nonzero(tie) > TIES:
            return
        yield tie


def _split(pattern: csc_array, least: float) -> tuple[float, tuple[Index, ...]] | None:
    """The unknowns of each part where that takes the least work, and this work, below `least`."""
    n = pattern.shape[1]
    best = None
    degree = np.diff(csc_array(pattern.T @ pattern).indptr)
    for most in _few(np.unique(degree)[:-1]):
        inner = np.flatnonzero(degree <= most)
        if float(n - inner.size) ** 3 > least:
            continue  # so many shared unknowns would be as much work
        own = tuple(inner[some] for some in tied_columns(pattern[:, inner].tocoo()))
        sizes, shared = np.array([part.size for part in own], dtype=float), n - inner.size
        work = float(np.sum((sizes + shared) ** 2 * sizes)) + float(shared) ** 3
        if work < least:
            least, best = work, (work, own)
    return best


def _few(degrees: Index) -> Index:
    """At most TRIES of these numbers, evenly spread."""
    if len(degrees) <= TRIES:
        return degrees
    return degrees[np.unique(np.linspace(0, len(degrees) - 1, TRIES).astype(np.int64))]


def _diagonal(numbers: Array) -> csr_array:
    n = len(numbers)
    return csr_array((numbers, np.arange(n), np.arange(n + 1)), shape=(n, n))
