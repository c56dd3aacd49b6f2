"""The singular values of a Jacobian, and which directions they determine."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array


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
