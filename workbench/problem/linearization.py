"""The linear model of a least-squares problem at one point."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
import scipy.linalg
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from workbench.arrays import Array, Index, Mask
from workbench.errors import NotFinite
from workbench.problem import storage
from workbench.problem.banded import BlockMatrix
from workbench.problem.constraints import LinearizedConstraints
from workbench.problem.optimality import all_finite, half_squared
from workbench.problem.steps import EPS, UNEVEN, automatic, factor_of
from workbench.problem.storage import Matrix, Symmetric, normal_equations


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The singular value decomposition of a Jacobian J (m, n), with k = min(m, n).

    A direction whose singular value is not above the tolerance counts as null.

    Attributes:
        s: (k,) the singular values, falling.
        Vt: (n, n) orthonormal rows v: |J v| is s for the first k, and 0 for the others.
        tolerance: the largest singular value that counts as zero.
    """

    s: Array
    Vt: Array
    tolerance: float

    @property
    def rank(self) -> int:
        """The number of singular values above the tolerance."""
        return int(np.sum(self.s > self.tolerance))

    @property
    def determined(self) -> tuple[Array, Array]:
        """The singular values above the tolerance, (rank,), and their directions (rank, n)."""
        above = self.s > self.tolerance
        return self.s[above], self.Vt[: self.s.size][above]


def graded_svd(R: Array, lengths: Array, relative: float) -> tuple[Array, Array]:
    """`s` (k,), falling, and Vt (n, n) of R (k, n), whose columns have these lengths (n,).

    Null directions are found in R with columns of length 1, where their singular values are at most
    `relative` times the largest; along them s is exactly zero here. See Drmac and Veselic, New fast
    and accurate Jacobi SVD algorithm, 2008.
    """
    k, n = R.shape
    nonzero = np.flatnonzero(lengths > 0)
    d, R = lengths[nonzero], R[:, nonzero]
    _, s_unit, Vt = np.linalg.svd(R / d, full_matrices=True)
    rank = int(np.sum(s_unit > relative * s_unit.max(initial=0.0)))
    null = Vt[rank:].T
    null[abs(null) < max(relative, EPS * nonzero.size)] = 0.0
    null = np.linalg.qr(null / d[:, None] * d.min())[0]
    Q = complement(null)
    determined, V = _by_jacobi(R @ Q)
    s, directions = np.zeros(k), np.zeros((n, n))
    s[:rank] = determined
    directions[:rank, nonzero] = V @ Q.T
    directions[rank : nonzero.size, nonzero] = null.T
    directions[np.arange(nonzero.size, n), np.flatnonzero(lengths == 0)] = 1.0
    return s, directions


def complement(N: Array) -> Array:
    """An orthonormal basis (n, n - d) of the complement of the orthonormal columns of N (n, d).

    Entries that are zero in all columns of N have basis vectors of their own.
    """
    n = len(N)
    part = np.flatnonzero(N.any(axis=1))
    local = scipy.linalg.null_space(N[part].T) if part.size else np.zeros((0, 0))
    Q = np.zeros((n, n - N.shape[1]))
    others = np.setdiff1d(np.arange(n), part)
    Q[others, np.arange(others.size)] = 1.0
    Q[part, others.size :] = local
    return Q


def _by_jacobi(R: Array) -> tuple[Array, Array]:
    """`s` (n,) and Vt (n, n) of R (k, n) of full column rank, small s as accurate as large ones."""
    if not R.shape[1]:
        return np.zeros(0), np.zeros((0, 0))
    scaled_s, _, V, work, _, failed = scipy.linalg.lapack.dgejsv(
        R, joba=0, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1
    )
    if failed:
        _, s, Vt = np.linalg.svd(R, full_matrices=False)
        return s, Vt
    return scaled_s * (work[0] / work[1]), V.T


def largest_eigenvalue(product: Callable[[Array], Array], n: int, accuracy: float) -> float:
    """The size of the eigenvalue of largest size, as by `largest_eigenpairs`; NaN where none is."""
    values, _ = largest_eigenpairs(product, n, 1, accuracy)
    return float(abs(values[0])) if len(values) else np.nan


def largest_eigenpairs(
    product: Callable[[Array], Array], n: int, most: int, accuracy: float
) -> tuple[Array, Array]:
    """The `most` eigenvalues (q,) of largest size, falling, of a symmetric matrix, by Lanczos.

    `product` takes a vector (n,) to the matrix times it, and `accuracy` is the relative error. With
    the values come their vectors (n, q), orthonormal. There are fewer where the method does not
    converge, and none where a product is not finite.
    """
    first = np.random.default_rng(0).standard_normal(n)
    if most < 1 or not np.isfinite(product(first)).all():
        return np.zeros(0), np.zeros((n, 0))
    if n <= max(2, most + 1):  # too small for the method
        matrix = np.column_stack([product(unit) for unit in np.eye(n)])
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    else:
        operator = LinearOperator((n, n), lambda v: product(v.ravel()), dtype=float)
        try:
            values, vectors = eigsh(operator, most, v0=first, tol=accuracy)
        except ArpackNoConvergence as error:
            values, vectors = error.eigenvalues, error.eigenvectors
    order = np.argsort(-abs(values))[:most]
    return np.asarray(values[order]), np.asarray(vectors[:, order])


NEGLIGIBLE_SHARE = 1e-9  # of an entry's unit vector in the null space, squared: as good as none


def covariance_without(s: Array, Vt: Array, lengths: Array) -> Array:
    """The covariance (n, n), infinite for what is not determined.

    J has the columns of U diag(s) V' times `lengths`; s (r,) and the rows of V' (r, n) are those of
    the determined directions. What V leaves out is the null space: an entry has the share 1 - sum
    of v_i^2 of its unit vector in it.
    """
    half = Vt.T / s / lengths[:, None]
    null = 1 - np.sum(Vt**2, axis=0) > NEGLIGIBLE_SHARE
    C: Array = half @ half.T
    C[null, :] = C[:, null] = np.nan
    C[null, null] = np.inf
    return C


def inverse_times(normal: Symmetric, right: Array, raised: Array | float = 0.0) -> Array | None:
    """(A + diag(raised))^-1 times an array (n, k), A = J'J; None where too few digits are left."""
    on_diagonal = np.broadcast_to(np.asarray(raised, dtype=float), normal.shape[:1])
    if not isinstance(normal, np.ndarray):
        factor = factor_of(normal, on_diagonal)
        return None if factor is None else factor.solve(right)
    try:
        lower = scipy.linalg.cho_factor(normal + np.diag(on_diagonal), lower=True)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(scipy.linalg.cho_solve(lower, right))


ROWS_AT_ONCE = 2**14  # in one QR of J: so many stay near the processor, and need little memory
ESTIMATED_TOLERANCE = 1e-7  # of the largest singular value; from J'J they have half the digits


@dataclass(frozen=True, eq=False)
class Linearization:
    """The linear model r(x + p) ~ r + J p, whitened, and textbook formulas for it.

    J is an array, or, where it is large and most of it is zero, sparse or made of blocks of frames.
    Ranks and directions come from R (min(m, n), n) with R'R = J'J, by QR of an array J. Otherwise,
    to save memory, R comes from the eigenvalues of J'J, and singular values are `estimated`.

    Attributes:
        residual: r (m,), whitened.
        jacobian: J (m, n), whitened; an array of a megabyte or more is read-only.
        constraints: the problem's constraints, linearized at the same point.
    """

    residual: Array
    jacobian: Matrix
    constraints: LinearizedConstraints | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns, (m, n)."""
        return self.jacobian.shape

    @property
    def estimated(self) -> bool:
        """Whether J is sparse, so that singular values are no better than 1e-8 of the largest."""
        return not isinstance(self.jacobian, np.ndarray)

    @property
    def by_frames(self) -> bool:
        """Whether J is stored by blocks of the frames of a sequence."""
        return isinstance(self.jacobian, BlockMatrix)

    @property
    def dense(self) -> Array:
        """J as an array. Raises TooLarge where that does not fit into memory."""
        return storage.dense(self.jacobian)

    @cached_property
    def cost(self) -> float:
        """1/2 |r|^2; infinite where that is too large to be a number."""
        return half_squared(self.residual)

    @cached_property
    def gradient(self) -> Array:
        """J' r, (n,), the gradient of the cost; infinite where it is too large to be a number."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self.jacobian.T @ self.residual

    @cached_property
    def normal(self) -> Symmetric:
        """J' J, (n, n), the Gauss-Newton Hessian, sparse if J is; infinite where too large."""
        products = normal_equations(self.jacobian, self.residual)
        if products is None:
            return storage.gram(self.jacobian)
        self.__dict__.setdefault("gradient", products[1])  # it is there in the same pass
        return products[0]

    @cached_property
    def column_norms(self) -> Array:
        """|J_i|, (n,): by how many sigmas one unit of each unknown changes the residual."""
        return storage.column_norms(self.jacobian, self.__dict__.get("normal"))

    @property
    def norm(self) -> float:
        """The Frobenius norm of J."""
        return float(np.linalg.norm(self.column_norms))

    def along(self, direction: Array) -> Array:
        """The directional derivative J d, (m,)."""
        return np.asarray(self.jacobian @ direction)

    def with_residual(self, residual: Array) -> "Linearization":
        """The same J with another residual (m,); J'J is not computed again."""
        other = Linearization(residual, self.jacobian, self.constraints)
        vars(other)["normal"] = self.normal  # a cached property of a frozen object
        return other

    def column(self, i: int) -> Array:
        """Column i of J, (m,)."""
        return storage.dense(storage.columns_of(self.jacobian, np.array([i]))).ravel()

    def block(self, rows: slice, columns: slice) -> "Linearization":
        """The linearization of some rows by some unknowns only."""
        part = self.rows(rows)
        return Linearization(part.residual, storage.unblocked(part.jacobian)[:, columns])

    @cached_property
    def finite(self) -> bool:
        """Whether every number of the residual, the Jacobian and the constraints is finite."""
        if not (isfinite(self.cost) or all_finite(self.residual)):
            return False
        if self.constraints is not None and not self.constraints.finite:
            return False
        # NaN or infinity in the Jacobian shows in J' r, even beside a residual of zero
        return all_finite(self.gradient) or bool(np.isfinite(storage.entries(self.jacobian)).all())

    @property
    def not_finite(self) -> list[tuple[int, int]]:
        """Rows and columns of entries of the Jacobian that are NaN or infinite."""
        return storage.where_not_finite(self.jacobian)

    @cached_property
    def svd(self) -> tuple[Array, Array, Array]:
        """`U, s, Vt` of the Jacobian, thin: s (k,) falls, the rows of Vt (k, n) are directions."""
        return np.linalg.svd(self.dense, full_matrices=False)

    @cached_property
    def singular_values(self) -> Array:
        """The singular values of J with columns of length 1, (k,), so that no unit matters."""
        return np.asarray(np.linalg.svd(self.unit_triangle, compute_uv=False), dtype=float)

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as null: eps max(m, n) s_1."""
        return float(self._relative * self.singular_values.max(initial=0.0))

    @property
    def rank(self) -> int:
        """How many independent directions change the residual."""
        return int(np.sum(self.singular_values > self.tolerance))

    @cached_property
    def triangle(self) -> tuple[Array, Array, Array]:
        """`d, R, b` such that |R (d p) + b|^2 is |J p + r|^2 up to a constant.

        d (n,) are the column norms, 1 where one is zero. J / d = Q R by QR, R (k, n) with
        k = min(m, n), and b (k,) is Q'r.
        """
        m, n = self.shape
        d, J, k = self.lengths, self.dense, min(self.shape)
        R = np.zeros((0, n + 1))
        for first in range(0, m, ROWS_AT_ONCE):  # rows above, reduced to R, and the next ones
            rows = slice(first, min(first + ROWS_AT_ONCE, m))
            A = np.empty((len(R) + rows.stop - first, n + 1), order="F")
            A[: len(R)] = R
            np.divide(J[rows], d, out=A[len(R) :, :n])
            A[len(R) :, n] = self.residual[rows]
            factor = scipy.linalg.qr(A, mode="r", overwrite_a=True, check_finite=False)[0]
            R = np.array(factor[: n + 1], dtype=float)
        return d, R[:k, :n], R[:k, n]

    @cached_property
    def unit_triangle(self) -> Array:
        """R (min(m, n), n) of the Jacobian with columns of length 1. Raises NotFinite, TooLarge."""
        if not self.finite:
            raise NotFinite("the Jacobian holds NaN or infinity here; see `not_finite` for where")
        if not self.estimated:
            return self.triangle[1]
        storage.check_wide(self.jacobian)
        unit = storage.scaled(self.jacobian, 1 / self.lengths)
        values, vectors = np.linalg.eigh(storage.dense(storage.gram(unit)))
        half = np.sqrt(np.maximum(values[::-1], 0))[:, None] * vectors[:, ::-1].T
        return np.asarray(half[: min(self.shape)])

    @cached_property
    def R(self) -> Array:
        """(min(m, n), n) with R'R = J'J. Raises NotFinite, TooLarge."""
        return self.unit_triangle * self.lengths

    @cached_property
    def spectrum(self) -> Spectrum:
        """The singular values of J, its columns in their own units, and its directions.

        Where some columns are a million times as long as others, Jacobi's rotations find small
        singular values to as many digits as large ones, and the tolerance is applied to columns of
        length 1; see `graded_svd`.
        """
        if self.uneven:
            s, Vt = graded_svd(self.R, self.column_norms, self._relative)
            least = s[s > 0].min(initial=np.inf) if s.any() else 0.0
            return Spectrum(s, Vt, float(self._relative * least))
        _, s, Vt = np.linalg.svd(self.R, full_matrices=True)
        return Spectrum(s, Vt, float(self._relative * s.max(initial=0.0)))

    @cached_property
    def uneven(self) -> bool:
        """Whether the columns differ so much in length that no single tolerance suits all."""
        nonzero = self.column_norms[self.column_norms > 0]
        return bool(nonzero.size and nonzero.max() > UNEVEN * nonzero.min())

    @cached_property
    def lengths(self) -> Array:
        """The lengths of the columns (n,), 1 where a column is zero."""
        return np.where(self.column_norms > 0, self.column_norms, 1.0)

    @cached_property
    def _by_rows(self) -> Array | csr_array:
        stored = storage.unblocked(self.jacobian)
        return stored.tocsr() if isinstance(stored, csc_array) else stored

    @property
    def _relative(self) -> float:
        return ESTIMATED_TOLERANCE if self.estimated else EPS * max(self.shape)

    def step(self, damping: float = 0.0, scaling: Array | float = 1.0) -> Array:
        """The p (n,) that minimises |J p + r|^2 + damping |D p|^2, D = diag(scaling).

        Without damping, this is the Gauss-Newton step; where J has no full rank, the shortest one.
        The scaling must be above zero. `steps.automatic` computes it.
        """
        D = np.array(np.broadcast_to(scaling, self.shape[1:]), dtype=float)
        return automatic(self, damping, D).p

    def without(self, held: Mask, p: Array) -> "Linearization":
        """The linearization by unknowns not `held` (n,), after the held ones have moved by p."""
        residual = self.residual + self.along(np.where(held, p, 0.0))
        smaller = Linearization(residual, storage.columns_of(self.jacobian, ~held))
        if type(smaller.jacobian) is type(self.jacobian):
            smaller.__dict__["normal"] = storage.part(self.normal, ~held)
        return smaller

    def holding(self, held: Mask, p: Array) -> "Linearization":
        """The linearization after the `held` unknowns have moved by p; their columns become 0."""
        residual = self.residual + self.along(np.where(held, p, 0.0))
        return Linearization(residual, storage.scaled(self.jacobian, np.where(held, 0.0, 1.0)))

    def rows(self, part: Index | slice) -> "Linearization":
        """The linearization of some rows only."""
        rows = self._by_rows[part]
        return Linearization(
            self.residual[part], csc_array(rows) if isinstance(rows, csr_array) else rows
        )

    def columns(self, part: Index) -> "Linearization":
        """The linearization by some unknowns only; the others keep their values."""
        return Linearization(self.residual, storage.columns_of(self.jacobian, part))

    def along_columns(self, basis: Array) -> "Linearization":
        """The linearization by unknowns y with x = basis @ y, basis (n, k)."""
        return Linearization(self.residual, storage.times(self.jacobian, basis))

    def scaled(self, factors: Array) -> "Linearization":
        """The linearization by unknowns y with x = factors * y, factors (n,)."""
        scaled = Linearization(self.residual, storage.scaled(self.jacobian, factors))
        if "triangle" in self.__dict__ and (factors > 0).all():  # units change its lengths alone
            _, R, b = self.triangle
            scaled.__dict__["triangle"] = scaled.lengths, R, b
        return scaled

    def predicted_decrease(self, p: Array) -> float:
        """By how much the linear model predicts that the step p (n,) lowers the cost."""
        if "normal" in self.__dict__:  # it is known already and small: J need not be read again
            curvature = float(p @ self.normal @ p)
        else:
            curvature = float(np.sum(self.along(p) ** 2))
        return -float(self.gradient @ p) - 0.5 * curvature

    def predicted_cost(self, step: Array) -> float:
        """The cost that the linear model predicts after a step p (n,): 1/2 |r + J p|^2."""
        return half_squared(self.residual + self.along(step))

    @property
    def covariance(self) -> Array:
        """Laplace's approximation to the posterior covariance, (J' J)^-1, (n, n).

        It is computed as R^-1 R^-T, with columns of length 1, and not from the normal equations,
        which would cost half of the digits. What is not identified has infinite variance, and NaN
        for its covariance with others.
        """
        R, lengths = self.unit_triangle, self.lengths
        _, s, Vt = np.linalg.svd(R, full_matrices=False)
        determined = s > self._relative * s.max(initial=0.0)
        if determined.sum() < len(lengths) or self.estimated:
            return covariance_without(s[determined], Vt[determined], lengths)
        half = scipy.linalg.solve_triangular(R, np.eye(len(lengths))) / lengths[:, None]
        return np.asarray(half @ half.T)

    def inverse_times(self, right: Array, raised: Array | float = 0.0) -> Array | None:
        """(J'J + diag(raised))^-1 times an array (n, k), such as some columns of the covariance.

        Computed by Cholesky's factor; None where that leaves too few digits.
        """
        return inverse_times(self.normal, right, raised)
