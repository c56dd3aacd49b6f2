"""The normal equations of a sequence: a band with a border, and Cholesky's factor of them.

In the order of the frames, unknowns meet only their neighbours; those that all frames share come
last, as a border. With A = [D B; B' C], first the band D is factorized, D = L L', by LAPACK's
dpbtrf, and then the Schur complement C - B' D^-1 B, which is small and dense. With N unknowns in
a band of half-width w that takes N w^2 operations.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from scipy.linalg import blas, lapack
from scipy.sparse import block_array, csc_array, diags_array

from workbench.arrays import Array
from workbench.problem.band_order import BandOrder
from workbench.problem.nonzeros import columns_of_nonzeros

SMALLEST = 1e-8  # of a pivot's square, beside the diagonal: below, half of the digits are lost


@dataclass(frozen=True, eq=False)
class BandedMatrix:
    """A symmetric matrix (n, n): a band, a border, and the corner where the border meets itself.

    Attributes:
        order: which unknowns make the band and which the border.
        band: (reach + 1, N) with band[i - j, j] = D[i, j] for i >= j, stored column by column.
        between: B (N, b), the band's rows in the border's columns.
        corner: C (b, b), the border's rows and columns.
    """

    order: BandOrder
    band: Array
    between: Array
    corner: Array

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
    """The factors of a banded matrix: D = L L', Y = L^-1 B, and that of C - Y'Y.

    Attributes:
        order: which unknowns make the band and which the border.
        L: Cholesky's factor of the band, stored as the band is.
        answer: Y (N, b).
        corner: Cholesky's factor of the Schur complement, lower, (b, b).
    """

    order: BandOrder
    L: Array
    answer: Array
    corner: Array

    def solve(self, right: Array) -> Array:
        """The solution (n,) or (n, k) of the linear system with this right-hand side."""
        order, found = self.order, np.empty_like(right, dtype=float)
        first = _triangular(self.L, right[order.inner], "N")
        rest = right[order.border] - self.answer.T @ first
        last = scipy.linalg.cho_solve((self.corner, True), rest) if len(rest) else rest
        found[order.border] = last
        found[order.inner] = _triangular(self.L, first - self.answer @ last, "T")
        return found

    def half_times(self, w: Array) -> Array:
        """M'^-1 w for w (n,) or (n, k), where M M' is the matrix that was factorized.

        If the entries of w are drawn from N(0, 1), the result is drawn from N(0, (M M')^-1).
        """
        order, found = self.order, np.empty_like(w, dtype=float)
        last = w[order.border]
        if len(last):
            last = scipy.linalg.solve_triangular(self.corner, last, lower=True, trans="T")
        found[order.border] = last
        found[order.inner] = _triangular(self.L, w[order.inner] - self.answer @ last, "T")
        return found


def _lost(pivots: Array, diagonal: Array) -> bool:
    return bool((pivots**2 < SMALLEST * diagonal).any())


def _triangular(L: Array, right: Array, transposed: str) -> Array:
    """L^-1, or L'^-1 if `transposed` is "T" and not "N", times a vector or a matrix."""
    if not right.size:
        return right.copy()
    wide = right if right.ndim == 2 else right[:, None]
    found, _ = lapack.dtbtrs(L, wide, uplo="L", trans=transposed)
    return np.asarray(found).reshape(right.shape)
