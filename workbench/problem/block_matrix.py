"""The Jacobian of a sequence: a dense block for each frame, and single entries.

With the unknowns x_t of frame t and the shared ones s, the rows of frame t are
r_t + J_t dx_t + B_t ds, and J'J is block diagonal but for a border, which belongs to s. Residuals
between neighbouring frames widen the diagonal to a band.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.problem.band_order import BandOrder
from workbench.problem.banded import BandedMatrix
from workbench.problem.nonzeros import columns_of_nonzeros, sums

AT_ONCE = 64  # frames whose products are kept at a time


@dataclass(frozen=True, eq=False)
class BlockPlaces:
    """The places of the blocks of T similar frames.

    Attributes:
        rows: (T, m) the rows of each block.
        columns: (T, n) the columns of each block.
    """

    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """A matrix (m, n): dense blocks (T, m_t, n_t), and the `rest`, which is zero in their places.

    Attributes:
        rest: (m, n) all entries that stand in no block.
        blocks: dense blocks (T, m_t, n_t), one array for each group of frames.
        places: for each of these arrays the rows and columns of its blocks.
        order: in which order the columns make a band of the normal equations.
    """

    rest: csc_array
    blocks: tuple[Array, ...]
    places: tuple[BlockPlaces, ...]
    order: BandOrder

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns, (m, n)."""
        m, n = self.rest.shape
        return int(m), int(n)

    __array_ufunc__ = None  # so that NumPy leaves products to this class

    def __matmul__(self, x: Array) -> Array:
        """Times a vector (n,) or an array (n, k): (m,) or (m, k)."""
        found = np.asarray(self.rest @ x)
        for block, at in zip(self.blocks, self.places, strict=True):
            some = x[at.columns]
            found[at.rows] = block @ some if x.ndim > 1 else (block @ some[:, :, None])[:, :, 0]
        return found

    @property
    def T(self) -> "Transposed":
        """The transposed matrix, for products with vectors."""
        return Transposed(self)

    def pulled(self, r: Array) -> Array:
        """The matrix, transposed, times a vector (m,): (n,)."""
        found = np.asarray(r @ self.rest)
        for block, at in zip(self.blocks, self.places, strict=True):
            part = (r[at.rows][:, None, :] @ block)[:, 0, :]
            np.add.at(found, at.columns, part)
        return found

    @property
    def entries(self) -> Array:
        """All stored numbers, flat."""
        return np.concatenate([self.rest.data, *(block.ravel() for block in self.blocks)])

    def column_squares(self) -> Array:
        """The sum of the squares of every column, (n,)."""
        found = sums(columns_of_nonzeros(self.rest), self.rest.data**2, self.shape[1])
        for block, at in zip(self.blocks, self.places, strict=True):
            np.add.at(found, at.columns, np.einsum("tij,tij->tj", block, block))
        return found

    def scaled(self, factors: Array) -> "BlockMatrix":
        """Every column times its factor, (n,)."""
        data = self.rest.data * np.repeat(factors, np.diff(self.rest.indptr))
        rest = csc_array((data, self.rest.indices, self.rest.indptr), shape=self.shape)
        blocks = (
            block * factors[at.columns][:, None, :]
            for block, at in zip(self.blocks, self.places, strict=True)
        )
        return BlockMatrix(rest, tuple(blocks), self.places, self.order)

    @property
    def dense(self) -> Array:
        """The matrix as an array, stored column by column."""
        found = np.asarray(self.rest.toarray(order="F"))
        for block, at in zip(self.blocks, self.places, strict=True):
            found[at.rows[:, :, None], at.columns[:, None, :]] = block
        return found

    @cached_property
    def sparse(self) -> csc_array:
        """The matrix by its nonzeros."""
        data, columns = [self.rest.data], [columns_of_nonzeros(self.rest)]
        rows = [self.rest.indices.astype(np.int64)]
        for block, at in zip(self.blocks, self.places, strict=True):
            data.append(block.ravel())
            rows.append(np.broadcast_to(at.rows[:, :, None], block.shape).ravel())
            columns.append(np.broadcast_to(at.columns[:, None, :], block.shape).ravel())
        at_both = (np.concatenate(rows), np.concatenate(columns))
        return csc_array((np.concatenate(data), at_both), shape=self.shape)

    def normal(self) -> BandedMatrix:
        """The matrix, transposed, times itself, (n, n)."""
        found = BandedMatrix.zeros(self.order)
        for block, at in zip(self.blocks, self.places, strict=True):
            place = self.order.of_frames(at.columns)
            for first in range(0, len(block), AT_ONCE):
                some = slice(first, first + AT_ONCE)
                J = block[some]
                place.put(found.band, found.between, found.corner, some, J.transpose(0, 2, 1) @ J)
        if self.rest.nnz:  # last, because `put` replaces entries and this adds to them
            found.add_sparse(csc_array(self.rest.T @ self.rest))
        return found


@dataclass(frozen=True, eq=False)
class Transposed:
    """A transposed block matrix."""

    of: BlockMatrix

    def __matmul__(self, r: Array) -> Array:
        """The product with a vector (m,): (n,)."""
        return self.of.pulled(r)


def joined(parts: Sequence[tuple[Index, Index]], shape: tuple[int, int]) -> "SparsePlaces":
    """The places in a sparse matrix of several parts of single entries, (rows, columns) each."""
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(r.ravel() for r, _ in parts)])
    columns = np.concatenate([np.zeros(0, dtype=np.int64), *(c.ravel() for _, c in parts)])
    order = np.lexsort((rows, columns))
    starts = np.searchsorted(columns[order], np.arange(shape[1] + 1))
    return SparsePlaces(order, rows[order].astype(np.int32), starts.astype(np.int32), shape)


@dataclass(frozen=True, eq=False)
class SparsePlaces:
    """The places of a sparse matrix whose numbers come part by part.

    Attributes:
        order: (nnz,) which of the numbers of all parts stands in each place.
        rows: (nnz,) the row of each place, column by column.
        starts: (n + 1,) where each column begins among the places.
        shape: the numbers of rows and columns, (m, n).
    """

    order: Index
    rows: NDArray[np.int32]
    starts: NDArray[np.int32]
    shape: tuple[int, int]

    def matrix(self, parts: Sequence[Array]) -> csc_array:
        """The sparse matrix with these numbers."""
        data = np.concatenate([np.zeros(0), *(part.ravel() for part in parts)])[self.order]
        return csc_array((data, self.rows, self.starts), shape=self.shape)
