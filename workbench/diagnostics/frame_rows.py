"""The Jacobian of a sequence taken apart: the rows of each frame, and the rows between frames.

With the unknowns of frame t called x_t and the shared ones s, the rows that belong to frame t are
J_t x_t + B_t s. All other rows are between frames, or of shared unknowns alone. All columns are
scaled to length 1, so that no unknown's unit matters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.problem import Linearization
from workbench.problem.banded import BlockMatrix
from workbench.problem.sparsity import rows_of_nonzeros
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class FrameRows:
    """The unknowns and the rows of each frame, and their numbers in columns of length 1.

    `own[t]` are the places of the unknowns of frame t, `shared` those of the unknowns that all
    frames share. `triangles[t]` (k, n_t + b) is R of [J_t B_t] by QR, with k <= n_t + b.

    Attributes:
        matrix: the Jacobian with columns of length 1, or zero.
        lengths: (n,) the lengths of its columns before; 1 where a column is zero.
        frame_of_row: (m,) the frame of each row; -1 for rows that belong to no single frame.
        own: for each frame the places of its unknowns.
        shared: (b,) the places of the unknowns that all frames share.
    """

    matrix: BlockMatrix
    lengths: Array
    frame_of_row: Index
    own: tuple[Index, ...]
    shared: Index

    @staticmethod
    def of(here: Linearization, frame_of_row: Index) -> "FrameRows":
        """The rows of a linearization whose Jacobian is a BlockMatrix; see `frames_of_rows`."""
        assert isinstance(here.jacobian, BlockMatrix)
        lengths = np.where(here.column_norms > 0, here.column_norms, 1.0)
        order = here.jacobian.order
        own = tuple(np.split(order.inner, order.edges[1:-1]))
        matrix = here.jacobian.scaled(1 / lengths)
        return FrameRows(matrix, lengths, frame_of_row, own, order.border)

    @property
    def count(self) -> int:
        """T, the number of frames."""
        return len(self.own)

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns, (m, n)."""
        return self.matrix.shape

    @cached_property
    def rest(self) -> csr_array:
        """The rows that belong to no single frame; all others are empty here."""
        data = csr_array(self.matrix.rest)
        rows = rows_of_nonzeros(data)
        keep = (self.frame_of_row[rows] < 0) & (data.data != 0)
        at = rows[keep], data.indices[keep]
        return csr_array((data.data[keep], at), shape=data.shape)

    @cached_property
    def triangles(self) -> tuple[Array, ...]:
        """[J_t B_t] of each frame, reduced by QR."""
        found: list[list[Array]] = [[] for _ in range(self.count)]
        place = np.full(self.shape[1], -1)
        for block, at in zip(self.matrix.blocks, self.matrix.places, strict=True):
            for J, rows, columns in zip(block, at.rows, at.columns, strict=True):
                t = int(self.frame_of_row[rows[0]]) if len(rows) else -1
                if t >= 0:
                    found[t].append(self._placed(t, J, columns, place))
        single = csr_array(self.matrix.rest)
        counts = np.diff(single.indptr)
        of_frames = np.flatnonzero((self.frame_of_row >= 0) & (counts > 0))
        by_frame = of_frames[np.argsort(self.frame_of_row[of_frames], kind="stable")]
        starts = np.searchsorted(self.frame_of_row[by_frame], np.arange(self.count + 1))
        for t in range(self.count):
            part = csr_array(single[by_frame[starts[t] : starts[t + 1]]])
            if part.nnz:
                columns = np.concatenate([self.own[t], self.shared])
                place[columns] = np.arange(len(columns))
                found[t].append(in_columns(part, place, len(columns)))
        return tuple(
            triangle(np.vstack([np.zeros((0, len(own) + len(self.shared))), *parts]))
            for own, parts in zip(self.own, found, strict=True)
        )

    def _placed(self, t: int, J: Array, columns: Index, place: Index) -> Array:
        """A block in the columns (own, shared) of its frame."""
        own = self.own[t]
        place[own] = np.arange(len(own))
        place[self.shared] = len(own) + np.arange(len(self.shared))
        return widened(J, place[columns], len(own) + len(self.shared))

    @cached_property
    def tolerance(self) -> float:
        """The size below which a singular value counts as zero: eps max(m, n) times the largest."""
        size = largest_singular_value(self.matrix)
        return float(np.finfo(float).eps * max(self.shape) * max(size, 1.0))


def largest_singular_value(matrix: BlockMatrix | csr_array) -> float:
    """The largest singular value of a matrix, by power iterations."""
    v: Array = np.ones(matrix.shape[1])
    size = 0.0
    for _ in range(30):
        length = float(np.linalg.norm(v))
        if not length:
            break
        v = np.asarray(matrix.T @ (matrix @ (v / length)))
        size = float(np.sqrt(np.linalg.norm(v)))
    return size


def frames_of_rows(residuals: Sequence[Residual]) -> Index:
    """The frame that each row of the stacked residual belongs to, (m,); -1 for none."""
    found = [np.zeros(0, dtype=np.int64)]
    for residual in residuals:
        if residual.by_frame:
            found += [np.full(one.size, t) for t, one in residual.by_frame]
        else:
            found.append(np.full(residual.size, -1))
    return np.concatenate(found)


def widened(A: Array, columns: Index, width: int) -> Array:
    """A in some of the columns of a matrix that is zero otherwise, (m, width)."""
    found = np.zeros((len(A), width))
    found[:, columns] = A
    return found


def in_columns(rows: csr_array, place: Index, width: int) -> Array:
    """Sparse rows as an array (m, width), each column at its `place`."""
    found = np.zeros((rows.shape[0], width))
    found[rows_of_nonzeros(rows), place[rows.indices]] = rows.data
    return found


def triangle(A: Array) -> Array:
    """R (min(m, n), n) of A (m, n) by QR: R'R = A'A."""
    m, n = A.shape
    if not m or not n:
        return A[: min(m, n)]
    return np.asarray(scipy.linalg.qr(A, mode="r", check_finite=False)[0][: min(m, n)], dtype=float)
