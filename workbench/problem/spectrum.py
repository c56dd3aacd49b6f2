"""The singular values of a Jacobian, and what they say is not noticed."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The singular values s (k,) of J (m, n), falling, k = min(m, n), and all of its directions.

    The rows of Vt (n, n) are orthonormal: |J v| = s for the first k, and 0 for the others. A
    direction whose singular value is not above the tolerance counts as unseen.
    """

    s: Array
    Vt: Array
    tolerance: float

    @property
    def rank(self) -> int:
        """How many singular values are above the tolerance."""
        return int(np.sum(self.s > self.tolerance))

    @property
    def seen(self) -> tuple[Array, Array]:
        """The singular values above the tolerance, (rank,), and their directions (rank, n)."""
        above = self.s > self.tolerance
        return self.s[above], self.Vt[: self.s.size][above]
