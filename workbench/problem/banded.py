"""The normal equations of a sequence: a band with a border, their order, and Cholesky's factor."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.linalg import blas, lapack
from scipy.sparse import block_array, csc_array, diags_array

from workbench.arrays import Array, Index
from workbench.problem.sparsity import columns_of_nonzeros, sums


@dataclass(frozen=True, eq=False)
class BandOrder:
    """Which unknowns make the band, and in which order, and which make the border."""

    inner: Index  # (N,) the places of those in the band among all unknowns, frame after frame
    border: Index  # (b,) the places of the shared ones among all unknowns
    reach: int  # the half-width of the band, how far from the diagonal its entries may stand
    edges: Index  # (T + 1,) where the unknowns of each frame begin among those of the band

    @property
    def size(self) -> int:
        """n = N + b, the number of unknowns."""
        return len(self.inner) + len(self.border)

    @cached_property
    def position(self) -> Index:
        """(n,) where each unknown stands among the inner ones; -1 in the border."""
        found = np.full(self.size, -1)
        found[self.inner] = np.arange(len(self.inner))
        return found

    @cached_property
    def in_border(self) -> Index:
        """(n,) where each unknown stands in the border; -1 in the band."""
        found = np.full(self.size, -1)
        found[self.border] = np.arange(len(self.border))
        return found

    def of_frames(self, columns: Index) -> "_BandPlaces":
        """The places of matrices of the unknowns `columns` (T, n) of T frames."""
        key = id(columns)
        if key not in self._known:
            self._known[key] = _BandPlaces.of(self, columns)
        return self._known[key]

    @cached_property
    def _known(self) -> dict[int, "_BandPlaces"]:
        return {}


@dataclass(frozen=True, eq=False)
class _BandPlaces:
    """Where the entries of matrices (n, n) of T similar frames stand in a banded matrix."""

    columns: Index  # (T, n) the unknowns of each frame; kept so that its identity is not reused
    inner: Index | slice  # which of the n are in the band, in the order of the band
    border: Index  # which of the n are in the border
    positions: Index  # (T, k) where the k unknowns in the band stand in it
    below: tuple[Index | slice, ...]  # for each of the k, how far below its diagonal others stand
    shared: Index  # where the unknowns in the border stand in it

    @staticmethod
    def of(order: BandOrder, columns: Index) -> "_BandPlaces":
        at = order.position[columns]
        inner, border = np.flatnonzero(at[0] >= 0), np.flatnonzero(at[0] < 0)
        inner = inner[np.argsort(at[0, inner])]
        positions = at[:, inner]
        apart = (positions[:, j:] - positions[:, [j]] for j in range(len(inner)))
        below = tuple(run_of(d[0]) if (d == d[0]).all() else d for d in apart)
        shared = order.in_border[columns[0, border]]
        return _BandPlaces(columns, run_of(inner), border, positions, below, shared)

    def put(self, band: Array, between: Array, corner: Array, some: slice, products: Array) -> None:
        """Put the symmetric matrices (T, n, n) of some of the frames into their places.

        `band`, `between` and `corner` are those of a `BandedMatrix`. Frames share places only in
        the corner, where their entries are added.
        """
        by_columns, positions = band.T, self.positions[some]
        own = products[:, self.inner][:, :, self.inner]
        for j, below in enumerate(self.below):
            if isinstance(below, slice):
                by_columns[positions[:, j], below] = own[:, j, j:]
            else:
                rows = below[some] if below.ndim > 1 else below
                by_columns[positions[:, j, None], rows] = own[:, j, j:]
        if self.border.size:
            across = products[:, self.inner][:, :, self.border]
            between[positions[:, :, None], self.shared] = across
            added = products[:, self.border[:, None], self.border].sum(axis=0)
            corner[np.ix_(self.shared, self.shared)] += added


def run_of(places: Index) -> "slice | Index":
    """The places as a slice if they are consecutive, which makes copying faster."""
    if len(places) and np.array_equal(places, places[0] + np.arange(len(places))):
        return slice(int(places[0]), int(places[-1]) + 1)
    return places


SMALLEST_PIVOT = 1e-8  # its square over the diagonal: below, half of the digits are lost


@dataclass(frozen=True, eq=False)
class BandedMatrix:
    """A symmetric matrix (n, n): a band, a border, and the corner where the border meets itself."""

    order: BandOrder  # which unknowns make the band and which the border
    band: Array  # (reach + 1, N), band[i - j, j] = D[i, j] for i >= j, stored column by column
    between: Array  # B (N, b), the band's rows in the border's columns
    corner: Array  # C (b, b), the border's rows and columns

    @staticmethod
    def zeros(order: BandOrder) -> "BandedMatrix":
        """A matrix of zeros."""
        N, b = len(order.inner), len(order.border)
        band = np.zeros((order.reach + 1, N), order="F")
        return BandedMatrix(order, band, np.zeros((N, b), order="F"), np.zeros((b, b)))

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns, (n, n)."""
        return self.order.size, self.order.size

    def add_sparse(self, matrix: csc_array) -> None:
        """Add a symmetric matrix (n, n), each of whose entries is in the band or in the border."""
        rows, columns = matrix.indices, columns_of_nonzeros(matrix)
        i, j = self.order.position[rows], self.order.position[columns]
        lower = (j >= 0) & (i >= j)
        memory = self.band.reshape(-1, order="F")
        i_low, j_low = i[lower], j[lower]
        memory[i_low - j_low + j_low * (self.order.reach + 1)] += matrix.data[lower]
        if self.order.border.size:
            s = self.order.in_border
            between = (i >= 0) & (j < 0)
            self.between[i[between], s[columns[between]]] += matrix.data[between]
            corner = (i < 0) & (j < 0)
            self.corner[s[rows[corner]], s[columns[corner]]] += matrix.data[corner]

    def diagonal(self) -> Array:
        """The diagonal, (n,)."""
        found = np.empty(self.order.size)
        found[self.order.inner] = self.band[0]
        found[self.order.border] = np.diag(self.corner)
        return found

    def __matmul__(self, x: Array) -> Array:
        """The product with a vector (n,)."""
        order, found = self.order, np.empty(self.order.size)
        inside, last = x[order.inner], x[order.border]
        product = np.zeros(0)
        if inside.size:
            product = blas.dsbmv(order.reach, 1.0, self.band, inside, lower=1)
        found[order.inner] = product + self.between @ last
        found[order.border] = self.between.T @ inside + self.corner @ last
        return found

    __array_ufunc__ = None  # so that NumPy leaves a product from the left to `__rmatmul__`

    def __rmatmul__(self, x: Array) -> Array:
        """A vector (n,) times the matrix."""
        return self @ x

    @cached_property
    def sparse(self) -> csc_array:
        """The matrix by its nonzeros."""
        order, N = self.order, len(self.order.inner)
        inside = np.arange(order.reach + 1)[:, None] + np.arange(N) < N
        k, j = np.nonzero((self.band != 0) & inside)
        low = csc_array((self.band[k, j], (k + j, j)), shape=(N, N))
        D = low + low.T - diags_array(self.band[0])
        parts = [[D, csc_array(self.between)], [csc_array(self.between.T), csc_array(self.corner)]]
        place = np.argsort(np.concatenate([order.inner, order.border]))
        found = csc_array(csc_array(block_array(parts, format="csc"))[:, place])[place]
        found.eliminate_zeros()
        found.sort_indices()
        return found

    def factorized(self, raised: Array | float = 0.0) -> "BandedFactor | None":
        """Cholesky's factor, with `raised` (n,) added to the diagonal.

        None where the matrix is not definite, or too few digits are left.
        """
        order, diagonal = self.order, self.diagonal() + raised
        if not (diagonal > 0).all() or not np.isfinite(diagonal).all():
            return None
        band, corner = self.band.copy(order="F"), self.corner.copy()
        band[0] = diagonal[order.inner]
        corner[np.diag_indices_from(corner)] = diagonal[order.border]
        L, failed = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if failed or _lost(L[0], diagonal[order.inner]):
            return None
        answer = _triangular(L, self.between, "N")
        corner, failed = lapack.dpotrf(corner - answer.T @ answer, lower=1, clean=1)
        if failed or _lost(np.diag(corner), diagonal[order.border]):
            return None
        return BandedFactor(order, L, answer, np.asarray(corner))


@dataclass(frozen=True, eq=False)
class BandedFactor:
    """The factors of a banded matrix: D = L L', Y = L^-1 B, and that of C - Y'Y."""

    order: BandOrder
    L: Array  # Cholesky's factor of the band, stored as the band is
    answer: Array  # Y (N, b)
    corner: Array  # Cholesky's factor of the Schur complement, lower, (b, b)

    def solve(self, right: Array) -> Array:
        """The solution (n,) or (n, k) of the linear system with this right-hand side."""
        order, found = self.order, np.empty_like(right, dtype=float)
        first = _triangular(self.L, right[order.inner], "N")
        rest = right[order.border] - self.answer.T @ first
        last = scipy.linalg.cho_solve((self.corner, True), rest) if len(rest) else rest
        found[order.border] = last
        found[order.inner] = _triangular(self.L, first - self.answer @ last, "T")
        return found


def _lost(pivots: Array, diagonal: Array) -> bool:
    return bool((pivots**2 < SMALLEST_PIVOT * diagonal).any())


def _triangular(L: Array, right: Array, transposed: str) -> Array:
    """L^-1, or L'^-1 if `transposed` is "T" and not "N", times a vector or a matrix."""
    if not right.size:
        return right.copy()
    wide = right if right.ndim == 2 else right[:, None]
    found, _ = lapack.dtbtrs(L, wide, uplo="L", trans=transposed)
    return np.asarray(found).reshape(right.shape)


FRAMES_AT_ONCE = 64  # whose products are kept at a time


class BlockPlaces(NamedTuple):
    """The rows (T, m) and the columns (T, n) of the blocks of T similar frames."""

    rows: Index
    columns: Index


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """A matrix (m, n): dense blocks, and the `rest`, which is zero in their places."""

    rest: csc_array  # (m, n) all entries that stand in no block
    blocks: tuple[Array, ...]  # dense blocks (T, m_t, n_t), one array for each group of frames
    places: tuple[BlockPlaces, ...]  # for each of these arrays the rows and columns of its blocks
    order: BandOrder  # in which order the columns make a band of the normal equations

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
    def T(self) -> "_Transposed":
        """The transposed matrix, for products with vectors."""
        return _Transposed(self)

    def vjp(self, r: Array) -> Array:
        """The matrix, transposed, times a vector (m,): (n,)."""
        found = np.asarray(r @ self.rest)
        for block, at in zip(self.blocks, self.places, strict=True):
            part = (r[at.rows][:, None, :] @ block)[:, 0, :]
            np.add.at(found, at.columns, part)
        return found

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
            for first in range(0, len(block), FRAMES_AT_ONCE):
                some = slice(first, first + FRAMES_AT_ONCE)
                J = block[some]
                place.put(found.band, found.between, found.corner, some, J.transpose(0, 2, 1) @ J)
        if self.rest.nnz:  # last, because `put` replaces entries and this adds to them
            found.add_sparse(csc_array(self.rest.T @ self.rest))
        return found


@dataclass(frozen=True, eq=False)
class _Transposed:
    of: BlockMatrix

    def __matmul__(self, r: Array) -> Array:
        return self.of.vjp(r)
