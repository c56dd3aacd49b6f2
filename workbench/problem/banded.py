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
        position = np.full(self.size, -1)
        position[self.inner] = np.arange(len(self.inner))
        return position

    @cached_property
    def border_position(self) -> Index:
        """(n,) where each unknown stands in the border; -1 in the band."""
        position = np.full(self.size, -1)
        position[self.border] = np.arange(len(self.border))
        return position

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
        in_band = order.position[columns]
        inner, border = np.flatnonzero(in_band[0] >= 0), np.flatnonzero(in_band[0] < 0)
        inner = inner[np.argsort(in_band[0, inner])]
        positions = in_band[:, inner]
        apart = (positions[:, j:] - positions[:, [j]] for j in range(len(inner)))
        below = tuple(run_of(d[0]) if (d == d[0]).all() else d for d in apart)
        shared = order.border_position[columns[0, border]]
        return _BandPlaces(columns, run_of(inner), border, positions, below, shared)

    def put(self, matrix: "BandedMatrix", frames: slice, products: Array) -> None:
        """Put the symmetric matrices (T, n, n) of some of the frames into their places.

        Frames share places only in the corner, where their entries are added.
        """
        by_columns, positions = matrix.band.T, self.positions[frames]
        in_band = products[:, self.inner][:, :, self.inner]
        for j, below in enumerate(self.below):
            if isinstance(below, slice):
                by_columns[positions[:, j], below] = in_band[:, j, j:]
            else:
                rows = below[frames] if below.ndim > 1 else below
                by_columns[positions[:, j, None], rows] = in_band[:, j, j:]
        if self.border.size:
            to_border = products[:, self.inner][:, :, self.border]
            matrix.between[positions[:, :, None], self.shared] = to_border
            in_corner = products[:, self.border[:, None], self.border].sum(axis=0)
            matrix.corner[np.ix_(self.shared, self.shared)] += in_corner


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
            k, m = self.order.border_position[rows], self.order.border_position[columns]
            between = (i >= 0) & (j < 0)
            self.between[i[between], m[between]] += matrix.data[between]
            corner = (i < 0) & (j < 0)
            self.corner[k[corner], m[corner]] += matrix.data[corner]

    def diagonal(self) -> Array:
        """The diagonal, (n,)."""
        diagonal = np.empty(self.order.size)
        diagonal[self.order.inner] = self.band[0]
        diagonal[self.order.border] = np.diag(self.corner)
        return diagonal

    def __matmul__(self, x: Array) -> Array:
        """The product with a vector (n,)."""
        order, product = self.order, np.empty(self.order.size)
        inner, outer = x[order.inner], x[order.border]
        of_band = np.zeros(0)
        if inner.size:
            of_band = blas.dsbmv(order.reach, 1.0, self.band, inner, lower=1)
        product[order.inner] = of_band + self.between @ outer
        product[order.border] = self.between.T @ inner + self.corner @ outer
        return product

    __array_ufunc__ = None  # so that NumPy leaves a product from the left to `__rmatmul__`

    def __rmatmul__(self, x: Array) -> Array:
        """A vector (n,) times the matrix."""
        return self @ x

    @cached_property
    def sparse(self) -> csc_array:
        """The matrix by its nonzeros."""
        order, N = self.order, len(self.order.inner)
        inside = np.arange(order.reach + 1)[:, None] + np.arange(N) < N
        below, columns = np.nonzero((self.band != 0) & inside)
        lower = csc_array((self.band[below, columns], (below + columns, columns)), shape=(N, N))
        D = lower + lower.T - diags_array(self.band[0])
        parts = [[D, csc_array(self.between)], [csc_array(self.between.T), csc_array(self.corner)]]
        position = np.argsort(np.concatenate([order.inner, order.border]))
        matrix = csc_array(csc_array(block_array(parts, format="csc"))[:, position])[position]
        matrix.eliminate_zeros()
        matrix.sort_indices()
        return matrix

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
        if failed or _digits_lost(L[0], diagonal[order.inner]):
            return None
        Y = _triangular(L, self.between, "N")
        corner, failed = lapack.dpotrf(corner - Y.T @ Y, lower=1, clean=1)
        if failed or _digits_lost(np.diag(corner), diagonal[order.border]):
            return None
        return BandedFactor(order, L, Y, np.asarray(corner))


@dataclass(frozen=True, eq=False)
class BandedFactor:
    """The factors of a banded matrix: D = L L', Y = L^-1 B, and that of C - Y'Y."""

    order: BandOrder
    L: Array  # Cholesky's factor of the band, stored as the band is
    Y: Array  # (N, b)
    corner: Array  # Cholesky's factor of the Schur complement, lower, (b, b)

    def solve(self, right: Array) -> Array:
        """The solution (n,) or (n, k) of the linear system with this right-hand side."""
        order, x = self.order, np.empty_like(right, dtype=float)
        of_band = _triangular(self.L, right[order.inner], "N")
        rest = right[order.border] - self.Y.T @ of_band
        of_border = scipy.linalg.cho_solve((self.corner, True), rest) if len(rest) else rest
        x[order.border] = of_border
        x[order.inner] = _triangular(self.L, of_band - self.Y @ of_border, "T")
        return x


def _digits_lost(pivots: Array, diagonal: Array) -> bool:
    return bool((pivots**2 < SMALLEST_PIVOT * diagonal).any())


def _triangular(L: Array, right: Array, transposed: str) -> Array:
    """L^-1, or L'^-1 if `transposed` is "T" and not "N", times a vector or a matrix."""
    if not right.size:
        return right.copy()
    wide = right if right.ndim == 2 else right[:, None]
    solution, _ = lapack.dtbtrs(L, wide, uplo="L", trans=transposed)
    return np.asarray(solution).reshape(right.shape)


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
        product = np.asarray(self.rest @ x)
        for block, place in zip(self.blocks, self.places, strict=True):
            own = x[place.columns]
            product[place.rows] = block @ own if x.ndim > 1 else (block @ own[:, :, None])[:, :, 0]
        return product

    @property
    def T(self) -> "_Transposed":
        """The transposed matrix, for products with vectors."""
        return _Transposed(self)

    def column_squares(self) -> Array:
        """The sum of the squares of every column, (n,)."""
        squares = sums(columns_of_nonzeros(self.rest), self.rest.data**2, self.shape[1])
        for block, place in zip(self.blocks, self.places, strict=True):
            np.add.at(squares, place.columns, np.einsum("tij,tij->tj", block, block))
        return squares

    def scaled(self, factors: Array) -> "BlockMatrix":
        """Every column times its factor, (n,)."""
        data = self.rest.data * np.repeat(factors, np.diff(self.rest.indptr))
        rest = csc_array((data, self.rest.indices, self.rest.indptr), shape=self.shape)
        blocks = (
            block * factors[place.columns][:, None, :]
            for block, place in zip(self.blocks, self.places, strict=True)
        )
        return BlockMatrix(rest, tuple(blocks), self.places, self.order)

    @property
    def dense(self) -> Array:
        """The matrix as an array, stored column by column."""
        array = np.asarray(self.rest.toarray(order="F"))
        for block, place in zip(self.blocks, self.places, strict=True):
            array[place.rows[:, :, None], place.columns[:, None, :]] = block
        return array

    @cached_property
    def sparse(self) -> csc_array:
        """The matrix by its nonzeros."""
        data, columns = [self.rest.data], [columns_of_nonzeros(self.rest)]
        rows = [self.rest.indices.astype(np.int64)]
        for block, place in zip(self.blocks, self.places, strict=True):
            data.append(block.ravel())
            rows.append(np.broadcast_to(place.rows[:, :, None], block.shape).ravel())
            columns.append(np.broadcast_to(place.columns[:, None, :], block.shape).ravel())
        coordinates = (np.concatenate(rows), np.concatenate(columns))
        return csc_array((np.concatenate(data), coordinates), shape=self.shape)

    def normal(self) -> BandedMatrix:
        """The matrix, transposed, times itself, (n, n)."""
        normal = BandedMatrix.zeros(self.order)
        for block, place in zip(self.blocks, self.places, strict=True):
            band_places = self.order.of_frames(place.columns)
            for first in range(0, len(block), FRAMES_AT_ONCE):
                frames = slice(first, first + FRAMES_AT_ONCE)
                J = block[frames]
                band_places.put(normal, frames, J.transpose(0, 2, 1) @ J)
        if self.rest.nnz:  # last, because `put` replaces entries and this adds to them
            normal.add_sparse(csc_array(self.rest.T @ self.rest))
        return normal


@dataclass(frozen=True, eq=False)
class _Transposed:
    matrix: BlockMatrix

    def __matmul__(self, r: Array) -> Array:
        """Times a vector (m,): (n,)."""
        matrix = self.matrix
        product = np.asarray(r @ matrix.rest)
        for block, place in zip(matrix.blocks, matrix.places, strict=True):
            own = (r[place.rows][:, None, :] @ block)[:, 0, :]
            np.add.at(product, place.columns, own)
        return product
