"""A sparse Jacobian taken apart: unknowns that few others meet, and those that all of them share.

Where the unknowns that meet most others are left out, the rest of a large problem often falls into
small parts that no row ties together: the vertices of a training beside the poses, the points of a
bundle adjustment beside the cameras. The unknowns of each part can then be eliminated by
themselves, see `Elimination`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index
from workbench.diagnostics.frame_rows import in_columns, largest_singular_value, triangle
from workbench.problem import Linearization
from workbench.problem.storage import by_nonzeros

CHEAPER = 0.1  # of the work of a dense factorisation: above, taking apart is not worth it
TRIES = 16  # ways to tell shared unknowns from the others
PAIRS = 1e8  # of unknowns in rows of J: with more, finding parts would take seconds
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Parts:
    """A Jacobian in columns of length 1, and the parts into which it falls.

    Attributes:
        shape: the numbers of rows and columns, (m, n).
        lengths: (n,) the lengths of the columns before; 1 where a column is zero.
        own: for each part the places of its unknowns.
        shared: (b,) the places of the unknowns that parts share.
        triangles: for each part R of its rows by QR, in the columns (own, shared).
        rest: the rows that read shared unknowns alone; all others are empty here.
        tolerance: the size below which a singular value counts as zero.
    """

    shape: tuple[int, int]
    lengths: Array
    own: tuple[Index, ...]
    shared: Index
    triangles: tuple[Array, ...]
    rest: csr_array
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
        own, shared = divided
        lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
        unit = csr_array(J @ _diagonal(1 / lengths))
        part_of = np.full(J.shape[1], -1)
        for k, places in enumerate(own):
            part_of[places] = k
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
        tolerance = EPS * max(J.shape) * max(largest_singular_value(unit), 1.0)
        return Parts(J.shape, lengths, own, shared, tuple(triangles), keep, tolerance)


def _divided(J: csc_array) -> tuple[tuple[Index, ...], Index] | None:
    """The unknowns of each part, and the shared ones, where that saves the most work.

    The unknowns that meet most others in rows of J are shared.
    """
    m, n = J.shape
    in_row = np.bincount(J.indices, minlength=m)
    if float(np.sum(in_row.astype(float) ** 2)) > PAIRS:
        return None
    pattern = csc_array((np.ones(J.nnz, dtype=np.int32), J.indices, J.indptr), shape=J.shape)
    degree = np.diff(csc_array(pattern.T @ pattern).indptr)
    least, best = CHEAPER * float(n) ** 3, None
    for most in _few(np.unique(degree)[:-1]):
        inner = np.flatnonzero(degree <= most)
        if float(n - inner.size) ** 3 > least:
            continue  # so many shared unknowns would be as much work
        read = pattern[:, inner].tocoo()
        ties = coo_array((read.data, (read.row, m + read.col)), shape=(m + inner.size,) * 2)
        label = np.unique(connected_components(ties, directed=False)[1][m:], return_inverse=True)[1]
        sizes, shared = np.bincount(label).astype(float), n - inner.size
        work = float(np.sum((sizes + shared) ** 2 * sizes)) + float(shared) ** 3
        if work < least:
            order = np.argsort(label, kind="stable")
            edges = np.cumsum(np.bincount(label))[:-1]
            least, best = work, tuple(np.split(inner[order], edges))
    if best is None:
        return None
    return best, np.setdiff1d(np.arange(n), np.concatenate(best))


def _few(degrees: Index) -> Index:
    """At most TRIES of these numbers, evenly spread."""
    if len(degrees) <= TRIES:
        return degrees
    return degrees[np.unique(np.linspace(0, len(degrees) - 1, TRIES).astype(np.int64))]


def _diagonal(numbers: Array) -> csr_array:
    n = len(numbers)
    return csr_array((numbers, np.arange(n), np.arange(n + 1)), shape=(n, n))
