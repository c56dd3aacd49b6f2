"""The damped linear least-squares step, by several factorizations, and which of them to trust.

Cholesky's factorization of the normal equations is trusted if the condition number of the Jacobian
with scaled columns is below 1e4; above, QR of the Jacobian takes its place, and the singular value
decomposition where columns depend on each other. With a sparse Jacobian, LSMR replaces the latter
two. Each iterate records which was used. Registrations with free vertices need no exact steps and
take conjugate gradients.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg
from scipy.linalg import lapack
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, lsmr, splu

from workbench.arrays import Array, Mask
from workbench.problem.banded import SMALLEST_PIVOT, BandedFactor, BandedMatrix
from workbench.problem.storage import Symmetric, crowded, dense, scaled_sparse, unblocked

if TYPE_CHECKING:
    from workbench.problem.linearization import Linearization

# SuperLU computes an LU factorization. In its symmetric mode, with pivots from the diagonal, it
# orders columns by minimum degree and has the fill-in of Cholesky's factorization.
SYMMETRIC = {"SymmetricMode": True}


@dataclass(frozen=True, eq=False)
class SparseFactor:
    """The factors of a positive definite matrix A (n, n), scaled so that its diagonal is one."""

    units: Array  # (n,) the square roots of A's diagonal
    border: Mask  # (n,) which unknowns come last; there are b of them
    inner: SuperLU | None  # the factor of S, A without the border; None where S is empty
    solved: Array  # S^-1 B, (n - b, b), with B the border's columns in the rows of S
    corner: Array  # Cholesky's factor of the Schur complement, lower, (b, b)

    def solve(self, b: Array) -> Array:
        """The solution A^-1 b for b (n,) or (n, k)."""
        units = self.units if b.ndim == 1 else self.units[:, None]
        right = b / units
        x = np.empty_like(right)
        of_inner = right[~self.border]
        first = of_inner if self.inner is None else np.asarray(self.inner.solve(of_inner))
        rest = right[self.border] - self.solved.T @ of_inner
        of_border = scipy.linalg.cho_solve((self.corner, True), rest) if self.border.any() else rest
        x[~self.border], x[self.border] = first - self.solved @ of_border, of_border
        return x / units


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
    solved = between if inner is None or not border.any() else np.asarray(inner.solve(between))
    L, failed = scipy.linalg.lapack.dpotrf(corner - between.T @ solved, lower=True, clean=True)
    if failed or np.diag(L).min(initial=1.0) ** 2 < SMALLEST_PIVOT:
        return None
    return SparseFactor(units, border, inner, solved, np.asarray(L))


def _inner(even: csc_array, part: Mask) -> SuperLU | None:
    """S of a matrix with ones on its diagonal; None if its pivots are too small, or it is empty."""
    if not part.any():
        return None
    S = even if part.all() else csc_array(csc_array(even[:, part])[part])
    try:
        factor = splu(S, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=SYMMETRIC)
    except RuntimeError:  # "Factor is exactly singular"
        return None
    return factor if factor.U.diagonal().min() >= SMALLEST_PIVOT else None


EPS = float(np.finfo(float).eps)
CHOLESKY_UP_TO = 1e4  # of the condition of the columns; its square is what Cholesky meets
UNEVEN = 1e6  # times the shortest column: a longer one would hide it among its rounding errors
LSMR_TOLERANCE, LSMR_PRODUCTS = 1e-12, 2000  # both of its tolerances; products at most
SLIGHT_DAMPING = 1e-7  # of the longest column's square, in the units of D
LEAST_DAMPED = 1e-5  # inverse condition, with its damping, of columns that are dependent


class Step(NamedTuple):
    """A step p (n,), and the name of the factorization that gave it."""

    p: Array
    by: str


LinearAlgebra = Callable[["Linearization", float, Array], Step | None]


def cholesky(here: "Linearization", damping: float, D: Array) -> Step | None:
    """The step by the normal equations J'J + damping D^2, scaled to a diagonal of ones.

    This is the fastest way for Jacobians with many more rows than columns. The condition number is
    the square of that of the Jacobian; None if that leaves too few digits.
    """
    normal = here.normal
    if not isinstance(normal, np.ndarray):
        factor = factor_of(normal, damping * D**2)
        which = "band" if isinstance(normal, BandedMatrix) else "sparse"
        return None if factor is None else Step(-factor.solve(here.gradient), f"{which} cholesky")
    A = normal.copy()
    np.einsum("ii->i", A)[:] += damping * D**2
    d = np.sqrt(A.diagonal())
    if not (d > 0).all() or not np.isfinite(d).all():
        return None
    A /= d
    A /= d[:, None]
    norm = np.abs(A).sum(axis=0).max()
    L, failed = lapack.dpotrf(A.T, lower=True, clean=False, overwrite_a=True)  # A.T is A: no copy
    if failed:
        return None
    inverse_condition, _ = lapack.dpocon(L, norm, uplo="L")
    if inverse_condition < CHOLESKY_UP_TO**-2:
        return None
    p, _ = lapack.dpotrs(L, here.gradient / d, lower=True)
    return Step(-p / d, "cholesky")


def qr(here: "Linearization", damping: float, D: Array) -> Step | None:
    """The step by QR of J, then of its triangle above sqrt(damping) D (Moré 1978).

    The condition number is not squared. None for a sparse Jacobian, and if the columns are
    dependent up to rounding and the damping is too small to compensate for this, so that rounding
    errors would grow. See Moré, The Levenberg-Marquardt algorithm: implementation and theory, 1978,
    section 3.
    """
    if here.estimated:
        return None
    d, R, b = here.triangle
    n = len(d)
    independent = len(R) == n and lapack.dtrcon(R)[0] > EPS * max(here.shape)
    if damping > 0:
        A = np.concatenate([R, np.diag(np.sqrt(damping) * D / d)])
        Q, R = scipy.linalg.qr(A, mode="economic", check_finite=False)
        b = Q[: len(b)].T @ b
    if not independent and (len(R) < n or lapack.dtrcon(R)[0] < LEAST_DAMPED):
        return None
    return Step(-scipy.linalg.solve_triangular(R, b, check_finite=False) / d, "qr")


def svd(here: "Linearization", damping: float, D: Array) -> Step:
    """The shortest step, by the singular values of J / D; null directions are left out.

    There is a step for every Jacobian. Without damping, D is the length of the columns if some are
    a million times as long as others, else the identity.
    """
    if damping == 0:
        D = here.lengths if here.uneven else np.ones_like(D)
    if (D == 1).all():
        U, s, Vt = here.svd
    else:
        U, s, Vt = np.linalg.svd(here.dense / D, full_matrices=False)
    determined = s > EPS * max(here.shape) * s.max(initial=0.0)
    s, U, Vt = s[determined], U[:, determined], Vt[determined]
    return Step(-(Vt.T @ ((U.T @ here.residual) / (s + damping / s))) / D, "svd")


def krylov(here: "Linearization", damping: float, D: Array) -> Step:
    """The shortest step by products with J and J' alone, for a sparse J with dependent columns.

    See Fong and Saunders, LSMR: an iterative algorithm for sparse least-squares problems, 2011.
    After `LSMR_PRODUCTS` products, the result is the best step so far, along which the cost falls.
    """
    if damping == 0:
        D = here.lengths if here.uneven else np.ones_like(D)
    A = scaled_sparse(here.jacobian, 1 / D)
    tolerances = LSMR_TOLERANCE, LSMR_TOLERANCE
    p = lsmr(A, -here.residual, np.sqrt(damping), *tolerances, conlim=0, maxiter=LSMR_PRODUCTS)[0]
    return Step(np.asarray(p) / D, "lsmr")


def automatic(here: "Linearization", damping: float, D: Array) -> Step:
    """The step by Cholesky while that keeps half of the digits, else by QR, else by the SVD.

    QR is used while the columns are independent. For a sparse Jacobian, the Cholesky factor is
    sparse, and `krylov` takes the place of QR and the SVD.
    """
    for factorize in (cholesky, qr):
        step = factorize(here, damping, D)
        if step is not None:
            return step
    return krylov(here, damping, D) if here.estimated else svd(here, damping, D)


def sparing(here: "Linearization", damping: float, D: Array) -> Step:
    """`automatic`, but for a sparse Jacobian a damping of at least 1e-7 of the longest column's
    square takes the place of `krylov`, whose shortest step takes hundreds of products.
    """
    step = cholesky(here, damping, D)
    if step is None and here.estimated:
        least = SLIGHT_DAMPING * float(np.max(here.column_norms / D, initial=0.0)) ** 2
        step = cholesky(here, max(damping, least), D)
    return automatic(here, damping, D) if step is None else step


def factor_of(
    normal: csc_array | BandedMatrix, raised: Array
) -> BandedFactor | SparseFactor | None:
    """The factor of A + diag(raised), raised (n,).

    None where the matrix is not positive definite or too few digits are left.
    """
    if isinstance(normal, BandedMatrix):
        return normal.factorized(raised)
    return factorized(csc_array(normal + diags_array(raised)) if raised.any() else normal)


LEAST_TRACE = 1e-12  # of a block's trace: a smaller eigenvalue of it is only rounding


@dataclass(frozen=True)
class ConjugateGradients:
    """A step by preconditioned conjugate gradients on the normal equations; a `LinearAlgebra`.

    It suits large sparse problems whose unknowns share residuals with few others. The
    preconditioner inverts the blocks of `block` consecutive unknowns on the diagonal of
    J'J + damping D^2, such as the three coordinates of one vertex (block Jacobi; Saad, Iterative
    methods for sparse linear systems, 2003, section 10.2). Unknowns that share residuals with more
    than an eighth of all, such as the pose of a body to which these vertices are tied, are a border
    that is one more block; so are those at the beginning that are left over when the others are
    divided into blocks. A border of b unknowns takes b x b numbers.

    The iterations begin at zero, so that the length of the step grows from one to the next, and the
    cost of the linear model falls (Steihaug, The conjugate gradient method and trust regions,
    1983): inexact steps slow convergence, but mislead no trust region. With a relative residual
    eta, Gauss-Newton's convergence is linear with about that rate (Dembo, Eisenstat and Steihaug,
    Inexact Newton methods, 1982).

    Attributes:
        block: how many consecutive unknowns make up a block.
        tolerance: the length of the normal equations' residual relative to the gradient, in the
            norm of the preconditioner, at which the iterations end.
        products: the largest number of iterations.
    """

    block: int = 3
    tolerance: float = 1e-3
    products: int = 500

    def __call__(self, here: "Linearization", damping: float, D: Array) -> Step:
        """The step (n,) that nearly minimises |J p + r|^2 + damping |D p|^2."""
        return Step(self.solved(here.normal, damping * D**2, -here.gradient), "conjugate gradients")

    def solved(self, normal: Symmetric, raised: Array, right: Array) -> Array:
        """The x (n,) with (A + diag(raised)) x = right, nearly, for a semidefinite A (n, n)."""
        A = csc_array(unblocked(normal))
        border = crowded(A)
        others = np.flatnonzero(~border)
        border[others[: len(others) % self.block]] = True
        order = np.concatenate([np.flatnonzero(border), np.flatnonzero(~border)])
        product, inverse = _bordered(A, border, raised, self.block)
        x, residual = np.zeros_like(right), right[order]
        preconditioned = inverse(residual)
        direction, square = preconditioned, float(residual @ preconditioned)
        least = self.tolerance**2 * square
        for _ in range(self.products):
            curved = product(direction)
            curvature = float(direction @ curved)
            if not (square > least and curvature > 0):
                break
            length = square / curvature
            x[order] += length * direction
            residual = residual - length * curved
            preconditioned = inverse(residual)
            square, previous = float(residual @ preconditioned), square
            direction = preconditioned + (square / previous) * direction
        return x


_Linear = Callable[[Array], Array]


def _bordered(A: csc_array, border: Mask, raised: Array, size: int) -> tuple[_Linear, _Linear]:
    """Products with A + diag(raised), and with its preconditioner, with the border first."""
    b, raised_inner = int(border.sum()), raised[~border]
    inner = csc_array(A if not b else csc_array(A[:, ~border])[~border])
    S = bsr_array(csr_array(inner.T), blocksize=(size, size))  # .T is S, by rows
    n = S.shape[0] // size
    rows = np.repeat(np.arange(n), np.diff(S.indptr))
    on_diagonal = rows == S.indices
    blocks = np.zeros((n, size, size))
    blocks[rows[on_diagonal]] = S.data[on_diagonal]
    blocks += np.eye(size) * raised_inner.reshape(n, 1, size)
    inverse = bsr_array((_inverse(blocks), np.arange(n), np.arange(n + 1)), shape=S.shape)
    columns = csc_array(A[:, border])
    between, corner = dense(csc_array(columns[~border])), dense(csc_array(columns[border]))
    corner = corner + np.diag(raised[border])
    inverse_of_corner = _inverse(corner[None])[0]

    def product(x: Array) -> Array:
        outer, others = x[:b], x[b:]
        if not b:
            return np.asarray(S @ others + raised_inner * others)
        first = corner @ outer + others @ between
        return np.concatenate([first, between @ outer + S @ others + raised_inner * others])

    def preconditioned(x: Array) -> Array:
        return np.concatenate([inverse_of_corner @ x[:b], inverse @ x[b:]])

    return product, preconditioned


def _inverse(blocks: Array) -> Array:
    """The inverses of matrices (k, n, n), slightly raised, so that a zero one has one too."""
    trace = np.trace(blocks, axis1=1, axis2=2)
    slight = np.where(trace > 0, LEAST_TRACE * trace, 1.0)
    return np.asarray(np.linalg.inv(blocks + slight[:, None, None] * np.eye(blocks.shape[1])))
