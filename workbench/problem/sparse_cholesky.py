"""Cholesky's factorization of sparse normal equations, by SciPy's SuperLU.

Most unknowns of a large problem share residuals with few others, as the vertices of a mesh do. A
few may share residuals with nearly all, as the pose of the body that the mesh belongs to. Those
come last, as a border: with A = [S B; B' C], first S is factorized, and then its Schur complement
C - B' S^-1 B, which is small and dense.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from workbench.arrays import Array, Mask
from workbench.problem.storage import crowded, dense

# SuperLU computes an LU factorization. In its symmetric mode, with pivots from the diagonal, it
# orders columns by minimum degree and has the fill-in of Cholesky's factorization.
SYMMETRIC = {"SymmetricMode": True}
SMALLEST = 1e-8  # of a pivot, where the diagonal is one: below that half of the digits are lost


@dataclass(frozen=True, eq=False)
class SparseFactor:
    """The factors of a positive definite matrix A (n, n), scaled so that its diagonal is one.

    Attributes:
        units: (n,) the square roots of A's diagonal.
        border: (n,) which unknowns come last; there are b of them.
        inner: the factor of S; None where all unknowns are in the border.
        between: B (n - b, b).
        answer: S^-1 B, (n - b, b).
        corner: Cholesky's factor of the Schur complement, lower, (b, b).
    """

    units: Array
    border: Mask
    inner: SuperLU | None
    between: Array
    answer: Array
    corner: Array

    def solve(self, b: Array) -> Array:
        """The solution A^-1 b for b (n,) or (n, k)."""
        units = self.units if b.ndim == 1 else self.units[:, None]
        right = b / units
        found = np.empty_like(right)
        first = right[~self.border]
        inside = first if self.inner is None else np.asarray(self.inner.solve(first))
        rest = right[self.border] - self.answer.T @ first
        last = scipy.linalg.cho_solve((self.corner, True), rest) if self.border.any() else rest
        found[~self.border], found[self.border] = inside - self.answer @ last, last
        return found / units


def factorized(A: csc_array) -> SparseFactor | None:
    """The factor of A (n, n); None if it is not positive definite, or too few digits are left."""
    diagonal = A.diagonal()
    if not (diagonal > 0).all() or not np.isfinite(A.data).all():
        return None
    units = np.sqrt(diagonal)
    even = csc_array(diags_array(1 / units) @ A @ diags_array(1 / units))
    border = crowded(even)
    inner = _inner(even, ~border)
    if inner is None and not border.all():
        return None
    columns = csc_array(even[:, border])
    between, corner = dense(csc_array(columns[~border])), dense(csc_array(columns[border]))
    answer = between if inner is None or not border.any() else np.asarray(inner.solve(between))
    L, failed = scipy.linalg.lapack.dpotrf(corner - between.T @ answer, lower=True, clean=True)
    if failed or np.diag(L).min(initial=1.0) ** 2 < SMALLEST:
        return None
    return SparseFactor(units, border, inner, between, answer, np.asarray(L))


def _inner(even: csc_array, part: Mask) -> SuperLU | None:
    """S of a matrix with ones on its diagonal; None if its pivots are too small, or it is empty."""
    if not part.any():
        return None
    S = even if part.all() else csc_array(csc_array(even[:, part])[part])
    try:
        factor = splu(S, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=SYMMETRIC)
    except RuntimeError:  # "Factor is exactly singular"
        return None
    return factor if factor.U.diagonal().min() >= SMALLEST else None
