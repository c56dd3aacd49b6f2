"""Parts that were eliminated by themselves, and the few rows that tie them together."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array, hstack

from workbench.arrays import Array, Mask
from workbench.diagnostics.elimination import TAKES_PART, Elimination
from workbench.diagnostics.parts import Parts

DIGITS_LOST = 1e10  # of the condition of S below: above, too few digits would be left


@dataclass(frozen=True, eq=False)
class TiedElimination:
    """The elimination of J = [J_0; C]: that of J_0, whose parts C ties together.

    What J_0 does not see is spanned by N, and J sees of it what C N does. With the covariance P of
    the rest and S = I + C P C', the covariance of J is P - P C' S^-1 C P + T (N'C' S^-1 C N)^-1 T',
    T = N - P C' S^-1 C N: Gaussian conditioning with a flat prior along N (Rasmussen and Williams,
    Gaussian Processes for Machine Learning, 2006, equation 2.42).

    Attributes:
        alone: the elimination of J_0.
        ties: C (q, n), in the same columns.
        tolerance: the size below which a singular value counts as zero.
    """

    alone: Elimination
    ties: csr_array
    tolerance: float

    @staticmethod
    def of(parts: Parts) -> "Elimination | TiedElimination | None":
        """The elimination of all rows; None where the order of elimination would lose digits."""
        alone = Elimination.of(parts)
        if not parts.ties.shape[0]:
            return alone
        tied = TiedElimination(alone, parts.ties, parts.tolerance)
        return tied if np.linalg.cond(tied._innovation) < DIGITS_LOST else None

    @property
    def rank(self) -> int:
        """How many directions are seen."""
        return self.alone.rank + int(self._seen[1].shape[1])

    @cached_property
    def null_vectors(self) -> csc_array:
        """(n, n - rank): a basis of what no row sees, each vector of length 1."""
        untouched, _, unseen = self._seen
        return csc_array(hstack([untouched, csc_array(unseen)]))

    @cached_property
    def variances(self) -> Array:
        """The diagonal of the inverse of J'J (n,); infinite where null vectors take part."""
        gained, (T, K) = np.linalg.solve(self._innovation, self._across.T), self._along_seen
        found = self.alone.variances_seen - np.sum(self._across * gained.T, axis=1)
        found += np.sum(T * np.linalg.solve(K, T.T).T, axis=1)
        return np.where(self.takes_part, np.inf, np.maximum(found, 0.0))

    def covariance_times(self, B: Array) -> Array:
        """The covariance times B (n, q), with what no row sees held at zero."""
        gained, (T, K) = np.linalg.solve(self._innovation, self._across.T @ B), self._along_seen
        along = T @ np.linalg.solve(K, T.T @ B)
        return np.asarray(self.alone.covariance_times(B) - self._across @ gained + along)

    def deviations(self, lengths: Array) -> Array:
        """Standard deviations (n,) of the unknowns, whose columns had these lengths (n,)."""
        return np.asarray(np.sqrt(self.variances) / lengths)

    @cached_property
    def takes_part(self) -> Mask:
        """Which unknowns a null vector moves, (n,)."""
        V = self.null_vectors
        return np.asarray(np.bincount(V.indices, V.data**2, minlength=V.shape[0]) > TAKES_PART)

    @cached_property
    def _across(self) -> Array:
        """P C' (n, q), the covariance of the unknowns with C times the unknowns, given J_0."""
        return self.alone.covariance_times(self.ties.T.toarray())

    @cached_property
    def _innovation(self) -> Array:
        """S = I + C P C' (q, q), the covariance of what the ties observe, noise included."""
        return np.asarray(np.eye(self.ties.shape[0]) + self.ties @ self._across)

    @cached_property
    def _along_seen(self) -> tuple[Array, Array]:
        """T (n, d) and N'C' S^-1 C N (d, d) of the null vectors of J_0 that C sees."""
        M = np.asarray(self.ties @ self._seen[1])
        weighted = np.linalg.solve(self._innovation, M)
        return np.asarray(self._seen[1] - self._across @ weighted), np.asarray(M.T @ weighted)

    @cached_property
    def _seen(self) -> tuple[csc_array, Array, Array]:
        """Null vectors of J_0 that C does not touch, and of the others the span that it sees and
        the one that it does not, orthonormal.
        """
        N = self.alone.null_vectors
        touched = np.linalg.norm((self.ties @ N).toarray(), axis=0) > self.tolerance
        Q = np.linalg.qr(N[:, touched].toarray())[0]
        _, s, Vt = np.linalg.svd(self.ties @ Q, full_matrices=True)
        rank = int(np.sum(s > self.tolerance))
        return csc_array(N[:, ~touched]), Q @ Vt[:rank].T, Q @ Vt[rank:].T
