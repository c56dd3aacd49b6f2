"""Rank, null space, weakest directions and covariances of a large sparse Jacobian.

Let S be the Jacobian above the gradients of active constraints, in columns of length 1. One
factorization serves all questions: S'S + eps I = L U, by SuperLU. The directions of small singular
values are those that (S'S + eps I)^-1 makes longest, and are found by inverse iteration with
several vectors V at once; their singular values are those of S V, and so have all digits, while
those of S'S have half of them (Golub and Van Loan, Matrix Computations, 2013, sections 8.2 and
8.6). The signs of the pivots say beforehand how many there are: by Sylvester's law of
inertia, S'S - c I has as many negative pivots as eigenvalues below c. Nothing here is as large as
n x n.

A row of many entries would make S'S full. Such rows C are kept apart from the others, S_0, as
unknowns of their own: [[S_0'S_0 + eps I, C'], [C, -I]] has the same solutions.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import (
    block_array,
    csc_array,
    csr_array,
    diags_array,
    tril,
    triu,
    vstack,
)
from scipy.sparse.linalg import SuperLU, splu

from workbench.arrays import Array, Mask
from workbench.diagnostics.bases import row_space
from workbench.errors import TooLarge
from workbench.problem import Linearization
from workbench.problem.linearization import largest_eigenpairs, largest_eigenvalue
from workbench.problem.steps import EPS
from workbench.problem.storage import Matrix, scaled_sparse, unblocked

SHIFT = 1e-11  # eps, in squares of singular values: above their rounding errors
WEAK = 3e-3  # singular values below it take part in the inverse iteration, and those
SMALL = 3e-5  # below this are split off: the solutions of the factorization have few digits there
ITERATIONS = 4  # each reduces what is left of others by (SMALL / WEAK)^2
SPARE_VECTORS = 8  # more than there are weak directions
MOST_REFINEMENTS = 5  # steps of iterative refinement
ACCURATE_STEP = 1e-9  # of the right-hand side: such a residual needs no refinement
LONG_ROW = 300  # entries from which on a row may be kept apart from S'S
FEW_LONG_ROWS = 0.1  # of the unknowns: if more rows are long, none of them is kept apart
MOST_NONZEROS = 5e7  # of L, about a gigabyte with U
MOST_WEAK_NUMBERS = 4e7  # in the vectors of weak directions together
NEGLIGIBLE_PIVOT = 1e-10  # so small a pivot says nothing of signs
FIRM = 1e-8  # what a forbidden direction may give way: 1 over the weight of its constraint
TAKES_PART = 1e-9  # squared entries of null vectors from which on an unknown is not known at all
LANCZOS_TOLERANCE = 1e-6  # relative error of the squares of singular values
AT_ONCE = 256  # columns that are multiplied by the inverse at a time
NOISE = 1e-12  # squares of singular values in columns of length 1 that are set apart from zero


@dataclass(frozen=True, eq=False)
class FactoredJacobian:
    """S (m, n), whose columns have the length 1 or 0, by a factorization of S'S.

    Attributes:
        S: the matrix.
        tolerance: the size up to which a singular value counts as zero: eps max(m, n) times the
            largest.
    """

    S: csc_array
    tolerance: float

    @staticmethod
    def of(S: csc_array) -> "FactoredJacobian":
        """The factorization of a matrix. Raises TooLarge where that would take too much memory."""
        m, n = S.shape
        tolerance = EPS * max(m, n) * max(largest_singular_value(S), 1.0)
        return FactoredJacobian(S, tolerance)

    @property
    def rank(self) -> int:
        """How many singular values are above the tolerance."""
        return int(self.S.shape[1] - self.null.shape[1])

    @cached_property
    def null(self) -> Array:
        """An orthonormal basis (n, n - rank) of the null space, unit vectors first."""
        s, V = self._small
        silent = np.flatnonzero(self._silent)
        units = np.zeros((len(V), silent.size))
        units[silent, np.arange(silent.size)] = 1.0
        return np.hstack([units, V[:, s <= self.tolerance]])

    @cached_property
    def takes_part(self) -> Mask:
        """Which unknowns a null vector moves, (n,)."""
        return np.asarray(np.sum(self.null**2, axis=1) > TAKES_PART)

    def covariance_times(self, B: Array) -> Array:
        """The pseudoinverse of S'S, times B (n, q)."""
        s, V = self._small
        seen = s > self.tolerance
        B = np.where(self._silent[:, None], 0.0, B)
        along = V.T @ B
        B -= V @ along
        X = self._without_small(self._solve(B))
        for _ in range(MOST_REFINEMENTS):
            residual = self._without_small(B - self.S.T @ (self.S @ X))
            if np.linalg.norm(residual) <= ACCURATE_STEP * np.linalg.norm(B):
                break
            X += self._without_small(self._solve(residual))
        return np.asarray(X + V[:, seen] @ (along[seen] / s[seen, None] ** 2))

    def _without_small(self, B: Array) -> Array:
        """B (n, q) without its part along the directions of small singular values."""
        V = self._small[1]
        return np.asarray(B - V @ (V.T @ B))

    @cached_property
    def _silent(self) -> Mask:
        """Which unknowns no row reads, (n,)."""
        return np.asarray(np.diff(self.S.indptr) == 0)

    @cached_property
    def _factors(self) -> SuperLU:
        n = self.S.shape[1]
        return _factorized(_system(self.S, np.ones(self.S.shape[0]), np.full(n, SHIFT)))

    def _solve(self, B: Array) -> Array:
        """(S'S + eps I)^-1 B, B (n, q)."""
        whole = np.zeros((self._factors.shape[0], B.shape[1]))
        whole[: len(B)] = B
        return np.asarray(self._factors.solve(whole)[: len(B)])

    @cached_property
    def _small(self) -> tuple[Array, Array]:
        """The singular values up to SMALL (k,), rising, and their directions (n, k), orthonormal.

        Unknowns that no row reads are left out.
        """
        n, silent = self.S.shape[1], self._silent
        shift = np.where(silent, 1.0, -(WEAK**2))
        count = count_negative(self.S, np.ones(self.S.shape[0]), shift)
        if not count:
            return np.zeros(0), np.zeros((n, 0))
        if count * n > MOST_WEAK_NUMBERS:
            raise TooLarge(
                f"{count:,} of {n:,} directions change the residuals little or not at all, too "
                "many to be told apart: fix some of the unknowns, or give them a prior"
            )
        start = np.random.default_rng(0).standard_normal(
            (n, min(count + SPARE_VECTORS, n - sum(silent)))
        )
        V = np.where(silent[:, None], 0.0, start)
        for _ in range(ITERATIONS):
            V = np.linalg.qr(self._solve(V))[0]
            V[silent] = 0.0
        s, V = self._ritz(V)
        null = s <= SMALL
        if null.any():  # a Newton step takes out what rounding has left of other directions
            others = V[:, ~null]
            moved = self._solve(self.S.T @ (self.S @ V[:, null]))
            moved -= V[:, null] @ (V[:, null].T @ moved)
            V = np.linalg.qr(V[:, null] - moved)[0]
            s, V = self._ritz(V - others @ (others.T @ V))
        return s, V

    def _ritz(self, V: Array) -> tuple[Array, Array]:
        """The singular values of S in the span of V (n, k), rising, and their directions."""
        Q = np.linalg.qr(V)[0]
        _, s, Wt = np.linalg.svd(np.linalg.qr(self.S @ Q, mode="r"), full_matrices=True)
        s = np.concatenate([s, np.zeros(Q.shape[1] - s.size)])
        return s[::-1], np.asarray(Q @ Wt[::-1].T)


@dataclass(frozen=True, eq=False)
class SparseJacobian:
    """A sparse Jacobian J (m, n) under constraints.

    Attributes:
        here: the linearization with the Jacobian J.
        rows: A (k, n), the gradients of active constraints and bounds.
        factored: J above A in columns of length 1.
        lengths: (n,) how long these columns are; 1 where one is zero.
    """

    here: Linearization = field(repr=False)
    rows: Array = field(repr=False)
    factored: FactoredJacobian = field(repr=False)
    lengths: Array = field(repr=False)

    @staticmethod
    def of(here: Linearization, rows: Array, stacked: Linearization) -> "SparseJacobian":
        """J under the constraints `rows`; `stacked` is J above them. Raises TooLarge."""
        lengths = np.where(stacked.column_norms > 0, stacked.column_norms, 1.0)
        S = scaled_sparse(stacked.jacobian, 1 / lengths).copy()  # its places are shared
        S.eliminate_zeros()
        return SparseJacobian(here, rows, FactoredJacobian.of(S), lengths)

    def scaled(self, factors: Array) -> "SparseJacobian":
        """The same in unknowns y with x = factors * y, factors (n,)."""
        return replace(
            self,
            here=self.here.scaled(factors),
            rows=self.rows * factors,
            lengths=self.lengths * factors,
        )

    @property
    def rank(self) -> int:
        """How many directions change a residual or are forbidden by a constraint."""
        return self.factored.rank

    @property
    def nullity(self) -> int:
        """How many directions no residual notices and no constraint forbids."""
        return self.here.shape[1] - self.rank

    @cached_property
    def null(self) -> Array:
        """(n, n - rank), orthonormal: what no residual notices and no constraint forbids."""
        return np.asarray(np.linalg.qr(self.factored.null / self.lengths[:, None])[0])

    @cached_property
    def forbidden(self) -> Array:
        """An orthonormal basis (r, n) of what the constraints forbid."""
        return row_space(self.rows)

    @cached_property
    def variances(self) -> Array:
        """The variance of each unknown (n,), infinite where a null direction moves it."""
        diagonal = [np.zeros(0)]
        for first, C in self.covariances():
            diagonal.append(C[first + np.arange(C.shape[1]), np.arange(C.shape[1])])
        held = np.sum(self.forbidden**2, axis=0) > 1 - NOISE
        variances = np.where(held, 0.0, np.maximum(np.concatenate(diagonal), 0.0))
        return np.where(self.factored.takes_part, np.inf, variances)

    def covariance_times(self, B: Array) -> Array:
        """C B for B (n, q), where C is a generalized inverse of J'J in the allowed directions.

        For every combination of unknowns that no null direction changes, C gives its covariance.
        """
        CB = self._generalized(B)
        if len(self.forbidden):
            P = self._across
            CB -= P @ np.linalg.solve(self.forbidden @ P, P.T @ B)
        return CB

    def covariances(self) -> Iterator[tuple[int, Array]]:
        """The covariance, a few columns at a time: the place of the first one, and these (n, q)."""
        n = self.here.shape[1]
        for first in range(0, n, AT_ONCE):
            yield first, self.covariance_times(np.eye(n, min(AT_ONCE, n - first), -first))

    def inverse_times(self, v: Array) -> Array:
        """The pseudoinverse of J'J along what may move, times v (n,)."""
        return self._seen(self.covariance_times(self._seen(v)[:, None])[:, 0])

    @cached_property
    def condition(self) -> float:
        """Largest over smallest singular value along what may move, without null directions.

        NaN where Lanczos' method does not converge.
        """
        J, A, n = self.here.jacobian, self.forbidden, self.here.shape[1]

        def normal(v: Array) -> Array:
            moved = J.T @ (J @ (v - A.T @ (A @ v)))
            return np.asarray(moved - A.T @ (A @ moved))

        smallest = largest_eigenvalue(self.inverse_times, n, LANCZOS_TOLERANCE)
        return float(np.sqrt(largest_eigenvalue(normal, n, LANCZOS_TOLERANCE) * smallest))

    def weakest(self, most: int) -> tuple[Array, Array]:
        """The smallest singular values above zero (q,), rising, and their directions (n, q).

        There are `most` of them, or fewer if J has fewer or if Lanczos' method does not find more.
        """
        n = self.here.shape[1]
        most = min(most, self.rank - len(self.forbidden))
        values, vectors = largest_eigenpairs(self.inverse_times, n, most, LANCZOS_TOLERANCE)
        return 1 / np.sqrt(values), vectors

    def count_below(self, limit: float) -> int:
        """How many singular values lie below this limit and above zero."""
        ones = np.ones(self.here.shape[0])
        return max(0, self._negative(ones, limit**2 / self.lengths**2) - self.nullity)

    def count_mostly_from(self, others: Mask) -> int:
        """How many directions all other rows determine better than the rows in `others` (m,) do."""
        shift = np.full(len(self.lengths), NOISE if self.nullity else 0.0)
        less = self._negative(np.where(others, -1.0, 1.0), shift)
        return len(self.lengths) - len(self.forbidden) - less

    def information_in(self, some: Mask) -> float:
        """In how many directions some rows (m,) decide: the sum of their leverages."""
        rows = csr_array(unblocked(self.here.jacobian))[np.flatnonzero(some)]
        leverage = 0.0
        for first in range(0, rows.shape[0], AT_ONCE):
            B = rows[first : first + AT_ONCE].T.toarray()
            leverage += float(np.sum(B * self.covariance_times(B)))
        return leverage

    def _negative(self, signs: Array, shift: Array) -> int:
        """How many eigenvalues of J' diag(signs) J - diag(shift) are negative along what may move,
        in columns of length 1.
        """
        J = scaled_sparse(self.here.jacobian, 1 / self.lengths)
        return count_negative(J, signs, -shift, self.rows / self.lengths)

    def _generalized(self, B: Array) -> Array:
        """A generalized inverse of J'J + A'A, times B (n, q)."""
        lengths = self.lengths[:, None]
        return np.asarray(self.factored.covariance_times(B / lengths) / lengths)

    @cached_property
    def _across(self) -> Array:
        """That times an orthonormal basis of what is forbidden, (n, r)."""
        return self._generalized(self.forbidden.T)

    def _seen(self, v: Array) -> Array:
        """What is left of v (n,) without null directions."""
        return np.asarray(v - self.null @ (self.null.T @ v))


def count_negative(S: csc_array, signs: Array, shift: Array, forbidden: Array | None = None) -> int:
    """How many eigenvalues of S' diag(signs) S + diag(shift) are negative, where forbidden rows
    (k, n) times a direction are zero.

    `signs` (m,) are 1 or -1. By Sylvester's law of inertia (Haynsworth, Determination of the
    inertia of a partitioned Hermitian matrix, Linear Algebra and its Applications 1, 1968).
    """
    for nudge in (0.0, 1e-7, -1e-7, 1e-6):  # a pivot may be zero by chance
        K = _system(S, signs, shift * (1 + nudge), forbidden)
        factors = _factorized(K)
        pivots = factors.U.diagonal()
        if (
            abs(pivots).min(initial=1.0) > NEGLIGIBLE_PIVOT
            and (factors.perm_r == factors.perm_c).all()
        ):
            break
    added = K.diagonal()[S.shape[1] :]
    return int(np.count_nonzero(pivots < 0)) - int(np.count_nonzero(added < 0))


def _system(S: csc_array, signs: Array, shift: Array, forbidden: Array | None = None) -> csc_array:
    """[[S_0' D_0 S_0 + diag(shift), C', A'], [C, -D_C, 0], [A, 0, -FIRM I]], D = diag(signs).

    C are the long rows of S, S_0 its other rows, and A what is `forbidden`, in length 1.
    """
    n, rows = S.shape[1], csr_array(S)
    entries = np.diff(rows.indptr)
    apart = entries > max(LONG_ROW, n / 20)
    if np.sum(apart) > FEW_LONG_ROWS * n:
        apart[:] = False
    others, signs_of_others = rows[~apart], signs[~apart]
    H = others.T @ (diags_array(signs_of_others) @ others) + diags_array(shift)
    below, corner = [rows[apart]], -signs[apart]
    if forbidden is not None and len(forbidden):
        below.append(csr_array(forbidden / np.linalg.norm(forbidden, axis=1)[:, None]))
        corner = np.append(corner, np.full(len(forbidden), -FIRM))
    if not corner.size:
        return csc_array(H)
    border = vstack(below)
    return csc_array(block_array([[H, border.T], [border, diags_array(corner)]], format="csc"))


def _factorized(K: csc_array) -> SuperLU:
    """A symmetric matrix K = L U with pivots on the diagonal. Raises TooLarge."""
    n = K.shape[0]
    if n**2 > MOST_NONZEROS and factor_size(K) > MOST_NONZEROS:
        raise TooLarge(
            f"the factor of a sparse Jacobian with {n:,} unknowns would have more than "
            f"{MOST_NONZEROS:,.0f} entries: free fewer blocks, or divide the problem into parts "
            "with few common unknowns"
        )
    return splu(
        K,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def factor_size(K: csc_array) -> int:
    """How many nonzeros the Cholesky factor of a matrix with this symmetric pattern has.

    For an approximate minimum degree ordering, counted no further than MOST_NONZEROS. In row i they
    are on the paths from its nonzeros up the elimination tree to i (Liu, The role of elimination
    trees in sparse factorization, SIAM Journal on Matrix Analysis and Applications 11, 1990).
    """
    n, order = K.shape[0], _pattern(K).amd()
    K = csc_array(csc_array(K[:, order])[order])
    parent, lower = _pattern(csc_array(triu(K))).etree(), csr_array(tril(K, -1))
    size, reached = n, [-1] * n
    starts, columns = lower.indptr.tolist(), lower.indices.tolist()
    for i in range(n):
        reached[i] = i
        for j in columns[starts[i] : starts[i + 1]]:
            while reached[j] != i:
                size, reached[j], j = size + 1, i, parent[j]
        if size > MOST_NONZEROS:
            break
    return size


def _pattern(matrix: csc_array) -> cs.Sparsity:
    return cs.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist(), True)


def largest_singular_value(matrix: Matrix) -> float:
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
