"""What singular values say of a Jacobian whose unknowns were eliminated, without all of them.

The elimination gives products with an inverse P of J'J. The smallest singular values come from its
largest eigenvalues, by Lanczos' method; how many of them lie below a limit, from signs alone, see
`inertia`. Nothing here is as large as n x n.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Mask
from workbench.diagnostics.elimination import Elimination
from workbench.diagnostics.inertia import negative_eigenvalues
from workbench.diagnostics.parts import Parts
from workbench.diagnostics.row_spaces import row_space
from workbench.diagnostics.tied_elimination import TiedElimination
from workbench.problem import Linearization
from workbench.problem.spectrum import largest_eigenpairs, largest_eigenvalue
from workbench.problem.storage import scaled, unblocked

ACCURATE = 1e-6  # relative error of the squares of singular values, by Lanczos' method
AT_ONCE = 256  # columns that are multiplied by the inverse at a time
NOISE = 1e-12  # squares of singular values in columns of length 1 that are set apart from zero


@dataclass(frozen=True, eq=False)
class EliminatedJacobian:
    """A Jacobian J (m, n) under constraints, whose unknowns were eliminated part after part.

    Attributes:
        here: the linearization with the Jacobian J.
        rows: A (k, n), the gradients of active constraints and bounds.
        eliminated: the elimination of J above A, in columns of length 1.
        parts: the parts that were eliminated.
        lengths: (n,) how long these columns are in J above A.
    """

    here: Linearization = field(repr=False)
    rows: Array = field(repr=False)
    eliminated: Elimination | TiedElimination = field(repr=False)
    parts: Parts = field(repr=False)
    lengths: Array = field(repr=False)

    def scaled(self, factors: Array) -> "EliminatedJacobian":
        """The same in unknowns y with x = factors * y, factors (n,)."""
        return replace(
            self,
            here=self.here.scaled(factors),
            rows=self.rows * factors,
            lengths=self.lengths * factors,
        )

    @property
    def nullity(self) -> int:
        """How many directions no residual notices and no constraint forbids."""
        return self.here.shape[1] - self.eliminated.rank

    @cached_property
    def forbidden(self) -> Array:
        """An orthonormal basis (r, n) of what the constraints forbid."""
        return row_space(self.rows)

    @cached_property
    def variances(self) -> Array:
        """The variance of each unknown (n,), infinite where a null direction moves it."""
        found = self.eliminated.variances / self.lengths**2
        if len(self.forbidden):
            P, inner = self._across
            found = found - np.sum(P * np.linalg.solve(inner, P.T).T, axis=1)
        return np.asarray(np.maximum(found, 0.0))

    def covariance_times(self, B: Array) -> Array:
        """C B for B (n, q), where C is a generalized inverse of J'J in the allowed directions.

        For every combination of unknowns that no null direction changes, C gives its covariance.
        """
        found = self._generalized(B)
        if len(self.forbidden):
            P, inner = self._across
            found -= P @ np.linalg.solve(inner, P.T @ B)
        return found

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

        smallest = largest_eigenvalue(self.inverse_times, n, ACCURATE)
        return float(np.sqrt(largest_eigenvalue(normal, n, ACCURATE) * smallest))

    def weakest(self, most: int) -> tuple[Array, Array]:
        """The smallest singular values above zero (q,), rising, and their directions (n, q).

        There are `most` of them, or fewer if J has fewer or if Lanczos' method does not find more.
        """
        n = self.here.shape[1]
        most = min(most, n - self.nullity - len(self.forbidden))
        values, vectors = largest_eigenpairs(self.inverse_times, n, most, ACCURATE)
        return 1 / np.sqrt(values), vectors

    def count_below(self, limit: float) -> int:
        """How many singular values lie below this limit and above zero."""
        ones = np.ones(self.here.shape[0])
        below = self._negative(ones, limit**2 / self.lengths**2)
        return max(0, below - self.nullity)

    def count_mostly_from(self, others: Mask) -> int:
        """How many directions all other rows determine better than the rows in `others` (m,) do."""
        signs = np.where(others, -1.0, 1.0)
        shift = np.full(len(self.lengths), NOISE if self.nullity else 0.0)
        less = self._negative(signs, shift)
        return len(self.lengths) - len(self.forbidden) - less

    def information_in(self, some: Mask) -> float:
        """In how many directions some rows (m,) decide: the sum of their leverages."""
        rows = csr_array(unblocked(self.here.jacobian))[np.flatnonzero(some)]
        found = 0.0
        for first in range(0, rows.shape[0], AT_ONCE):
            B = rows[first : first + AT_ONCE].T.toarray()
            found += float(np.sum(B * self.covariance_times(B)))
        return found

    def covariances(self) -> Iterator[tuple[int, Array]]:
        """The covariance, a few columns at a time: the place of the first one, and these (n, q)."""
        n = self.here.shape[1]
        for first in range(0, n, AT_ONCE):
            yield first, self.covariance_times(np.eye(n, min(AT_ONCE, n - first), -first))

    def _negative(self, signs: Array, shift: Array) -> int:
        J = csr_array(unblocked(scaled(self.here.jacobian, 1 / self.lengths)))
        return negative_eigenvalues(self.parts, J, signs, shift, self.rows / self.lengths)

    def _generalized(self, B: Array) -> Array:
        """A generalized inverse of J'J + A'A, times B (n, q)."""
        by = self.lengths[:, None]
        return np.asarray(self.eliminated.covariance_times(B / by) / by)

    @cached_property
    def _across(self) -> tuple[Array, Array]:
        """P A' (n, r) and A P A' (r, r) for an orthonormal basis A of what is forbidden."""
        P = self._generalized(self.forbidden.T)
        return P, self.forbidden @ P

    @cached_property
    def null(self) -> Array:
        """(n, n - rank), orthonormal: what no residual notices and no constraint forbids."""
        return np.asarray(
            np.linalg.qr(self.eliminated.null_vectors.toarray() / self.lengths[:, None])[0]
        )

    def _seen(self, v: Array) -> Array:
        return np.asarray(v - self.null @ (self.null.T @ v))
