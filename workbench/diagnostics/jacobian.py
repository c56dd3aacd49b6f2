"""The whitened Jacobian at one point, dense or sparse, and the triangle that stands for it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array, csr_array, issparse

from workbench.blocks import Layout
from workbench.diagnostics.graded import graded_svd
from workbench.errors import WorkbenchError
from workbench.problem import Problem
from workbench.problem.steps import EPS, UNEVEN

Array = NDArray[np.float64]
THIN = 1e-3  # of its column's largest entry: smaller ones hardly matter
DENSE_UP_TO = 3e7  # entries: 240 MB; above it nothing of m x n is ever dense
WIDE = 4000  # columns of a sparse Jacobian whose n x n matrices still fit


class NotFinite(WorkbenchError):
    """A Jacobian that holds NaN or infinity has no rank."""


@dataclass(frozen=True, eq=False)
class Jacobian:
    """r (m,) and J (m, n) of a problem at one point.

    All that asks for the geometry of the columns is asked of R (min(m, n), n), R'R = J'J: R has
    J's singular values and null space. From a dense J it comes by QR, and is upper triangular;
    from a sparse one, to keep memory small, from the eigenvalues of J'J, which resolve singular
    values only down to 1e-8 of the largest: `estimated` says so.
    """

    residual: Array
    matrix: Array | csc_array

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n)."""
        return int(self.matrix.shape[0]), int(self.matrix.shape[1])

    @property
    def estimated(self) -> bool:
        """Whether singular values come from J'J, and are no better than 1e-8 of the largest."""
        return issparse(self.matrix)

    @cached_property
    def finite(self) -> bool:
        """Whether all of r and J is."""
        entries = self.matrix.data if isinstance(self.matrix, csc_array) else self.matrix
        return bool(np.isfinite(self.residual).all() and np.isfinite(entries).all())

    @property
    def not_finite(self) -> list[tuple[int, int]]:
        """Rows and columns of entries that are NaN or infinite."""
        if isinstance(self.matrix, csc_array):
            entries = self.matrix.tocoo()
            bad = ~np.isfinite(entries.data)
            rows, columns = entries.row[bad], entries.col[bad]
        else:
            rows, columns = np.nonzero(~np.isfinite(self.matrix))
        return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True)]

    @cached_property
    def R(self) -> Array:
        """(min(m, n), n); raises NotFinite."""
        self._check()
        if isinstance(self.matrix, csc_array):
            d = self._lengths
            values, vectors = np.linalg.eigh(self.normal / np.outer(d, d))
            half = np.sqrt(np.maximum(values[::-1], 0))[:, None] * vectors[:, ::-1].T
            return np.asarray((half * d)[: min(self.shape)])
        return np.asarray(scipy.linalg.qr(self.matrix, mode="r")[0][: min(self.shape)])

    @cached_property
    def svd(self) -> tuple[Array, Array]:
        """`s` (min(m, n),), falling, and all right singular vectors as the rows of Vt (n, n).

        Where some columns are a million times as long as others, by Jacobi's rotations, which
        find small singular values to as many digits as large ones (Drmac and Veselic, New fast and
        accurate Jacobi SVD algorithm, 2008); else a short column would be lost in the rounding
        errors of the long ones.
        """
        if self.uneven:
            return graded_svd(self.R, self.column_norms, self._relative)
        if isinstance(self.matrix, csc_array):
            self._check()
            values, vectors = np.linalg.eigh(self.normal)
            s = np.sqrt(np.maximum(values[::-1], 0))
            return s[: min(self.shape)], np.asarray(vectors[:, ::-1].T)
        _, s, Vt = np.linalg.svd(self.R, full_matrices=True)
        return s[: min(self.shape)], Vt

    @cached_property
    def _lengths(self) -> Array:
        """Of the columns, 1 where one is zero, (n,)."""
        return np.where(self.column_norms > 0, self.column_norms, 1.0)

    @cached_property
    def uneven(self) -> bool:
        """Whether columns differ so much that one tolerance does not serve all."""
        read = self.column_norms[self.column_norms > 0]
        return bool(read.size and read.max() > UNEVEN * read.min())

    @property
    def normal(self) -> Array:
        """J'J (n, n), dense."""
        if isinstance(self.matrix, csc_array):
            return np.asarray((self.matrix.T @ self.matrix).toarray())
        return self.matrix.T @ self.matrix

    def _check(self) -> None:
        if not self.finite:
            raise NotFinite("the Jacobian holds NaN or infinity here; see `not_finite` for where")

    @property
    def _relative(self) -> float:
        return 1e-7 if self.estimated else EPS * max(self.shape)

    @cached_property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as unseen: eps max(m, n) s_1, or
        1e-7 s_1 where singular values are estimates.

        Where some columns are a million times as long as others, the rule is kept for J with
        columns of length 1, and what is unseen has the singular value 0: see `graded_svd`.
        """
        s = self.svd[0]
        if not self.uneven:
            return float(self._relative * s.max(initial=0.0))
        return float(self._relative * s[s > 0].min(initial=np.inf)) if s.any() else 0.0

    @property
    def rank(self) -> int:
        """How many singular values are above the tolerance."""
        return int(np.sum(self.svd[0] > self.tolerance))

    @cached_property
    def column_norms(self) -> Array:
        """|J_i| (n,)."""
        if isinstance(self.matrix, csc_array):
            return np.sqrt(np.asarray(self.matrix.power(2).sum(axis=0)).ravel())
        return np.asarray(np.sqrt(np.einsum("ij,ij->j", self.matrix, self.matrix)))

    @cached_property
    def row_norms(self) -> Array:
        """Of every row, (m,)."""
        if isinstance(self.matrix, csc_array):
            return np.sqrt(np.asarray(self.matrix.power(2).sum(axis=1)).ravel())
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", self.matrix, self.matrix)))

    def column(self, i: int) -> Array:
        """One column, (m,)."""
        column = self.matrix[:, [i]]
        return np.asarray(column.toarray() if issparse(column) else column).ravel()

    @property
    def dense(self) -> Array:
        """J as an array; ask this of small parts only."""
        return np.asarray(self.matrix.toarray() if issparse(self.matrix) else self.matrix)

    def row(self, i: int) -> Array:
        """One row, (n,)."""
        row = self._by_rows[[i]]
        return np.asarray(row.toarray() if issparse(row) else row).ravel()

    @cached_property
    def thick(self) -> int:
        """How many entries are above a thousandth of their column's largest."""
        if isinstance(self.matrix, csc_array):
            largest = np.asarray(abs(self.matrix).max(axis=0).toarray()).ravel()
            columns = np.repeat(np.arange(self.shape[1]), np.diff(self.matrix.indptr))
            return int(np.sum(abs(self.matrix.data) > THIN * largest[columns]))
        size = abs(self.matrix)
        return int(np.sum(size > THIN * size.max(axis=0, initial=0.0)))

    @property
    def norm(self) -> float:
        """Frobenius' norm of J."""
        return float(np.linalg.norm(self.column_norms))

    def along(self, direction: Array) -> Array:
        """J d (m,)."""
        return np.asarray(self.matrix @ direction)

    def rows(self, part: NDArray[np.int64]) -> "Jacobian":
        """Some rows alone."""
        some = self._by_rows[part]
        return Jacobian(self.residual[part], csc_array(some) if issparse(some) else some)

    def columns(self, part: NDArray[np.int64]) -> "Jacobian":
        """Some columns alone, dense where they fit."""
        some = self.matrix[:, part]
        if isinstance(some, csc_array) and some.shape[0] * some.shape[1] <= DENSE_UP_TO / 4:
            return Jacobian(self.residual, np.asarray(some.toarray()))
        return Jacobian(self.residual, some)

    def block(self, rows: slice, columns: slice) -> Array | csr_array:
        """Some rows and columns."""
        return self._by_rows[rows][:, columns]

    @cached_property
    def _by_rows(self) -> Array | csr_array:
        return self.matrix.tocsr() if isinstance(self.matrix, csc_array) else self.matrix


def jacobian_at(problem: Problem, at: Mapping[str, ArrayLike]) -> Jacobian:
    """By the chain rule where it fits as a dense array, from the whole graph where it does not.

    Columns that are nothing but rounding errors are zero in it: see `only_rounding`.
    """
    x, fixed = problem.split(at)
    m, n = problem.size, problem.free.size
    if m * n <= DENSE_UP_TO:
        here = problem.linearize(at)
        noise = only_rounding(here.column_norms, x, problem.free, m)
        matrix = np.where(noise, 0.0, here.jacobian) if noise.any() else here.jacobian
        return Jacobian(here.residual, matrix)
    if n > WIDE:
        raise WorkbenchError(
            f"a Jacobian of {m} x {n} is more than the diagnosis can look at; up to {WIDE} "
            "columns are: free fewer blocks"
        )
    r, J = problem.derivative(x, fixed)
    starts, rows = J.sparsity().get_ccs()
    entries = np.asarray(J.nonzeros())
    return Jacobian(np.asarray(r).ravel(), csc_array((entries, rows, starts), shape=J.shape))


def only_rounding(lengths: Array, x: Array, free: Layout, m: int) -> NDArray[np.bool_]:
    """Which columns, of these lengths (n,) in m rows at x, may be nothing but rounding, (n,).

    Entries of one unit can be compared: a column is, if it is below eps max(m, n) of the longest
    of its unit. Entries without a unit cannot; there, and everywhere, it is if a change by one, or
    by the size of x_i if that is more, changes the rows by less than the rounding error of one
    sigma, or of the longest column if that is shorter.
    """
    units = np.array([block.unit for block in free.blocks for _ in range(block.size)])
    longest = float(lengths.max(initial=0.0))
    least = np.full(lengths.shape, 10 * EPS * np.sqrt(m) * min(1.0, longest))
    for unit in set(units.tolist()) - {"1"}:
        alike = units == unit
        own = EPS * max(m, len(lengths)) * float(lengths[alike].max())
        least[alike] = np.maximum(least[alike], own)
    return np.asarray((lengths > 0) & (lengths * np.maximum(1.0, abs(x)) <= least))


def pattern_of(function: cs.Function) -> csc_array:
    """Where the Jacobian of a function's first output by its first input can be nonzero (m, n)."""
    sparsity = function.jac_sparsity(0, 0)
    starts, rows = sparsity.get_ccs()
    return csc_array((np.ones(len(rows), dtype=bool), rows, starts), shape=sparsity.shape)
