"""What is known of all unknowns at one point, and what rows of a measurement would change of it.

With C = (J'J)^-1 = H H' and the whitened rows A of a measurement, Woodbury's formula says

    (J'J + A'A)^-1 = H (I + H'A'A H)^-1 H' = H' H'',   H' = H (I - V diag(1 - 1 / sqrt(1 + s^2)) V')

with A H = U diag(s) V'. The half H is updated and not C, because a difference of covariances would
lose digits where a measurement says much (Potter's square root filter; Bierman, Factorization
Methods for Discrete Sequential Estimation, 1977). By the determinant lemma the information grows by
the sum of log(1 + s^2) / 2, in nats.
"""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The covariance of n unknowns, each in units of its yardstick.

    Along null directions the variance has no limit; elsewhere it is that of a prior along them that
    becomes ever wider, the same in every direction.

    Attributes:
        half: (n, r) H, with H H' the covariance of what is determined.
        null: (n, d) an orthonormal basis of the directions that nothing determines.
        triangle: (k, n) R with R'R = J'J; without rows where everything is determined.
        left: (n, p) an orthonormal basis of the directions that equations leave free; None where
            there are no equations. In all others everything is known exactly.
    """

    half: Array
    null: Array
    triangle: Array
    left: Array | None = None

    @staticmethod
    def of(here: Linearization, left: Array | None = None) -> "Uncertainty":
        """By the singular values of a linearization. Raises NotFinite, TooLarge."""
        spectrum = (here if left is None else here.along_columns(left)).spectrum
        s, Vt = spectrum.determined
        half, null = Vt.T / s, spectrum.Vt[spectrum.rank :].T
        if left is not None:
            half, null = left @ half, left @ null
        R = here.R if null.shape[1] else np.zeros((0, here.shape[1]))
        return Uncertainty(half, null, R, left)

    def seeing(self, rows: Array) -> "Uncertainty":
        """What is known after whitened rows (m, n) were measured as well."""
        if self.null.shape[1]:
            stacked = np.vstack([self.triangle, rows])
            return Uncertainty.of(Linearization(np.zeros(len(stacked)), stacked), self.left)
        _, s, Vt = np.linalg.svd(rows @ self.half, full_matrices=False)
        root = np.sqrt(1 + s**2)
        shrunk = s**2 / (root * (1 + root))  # 1 - 1 / root, without its rounding errors
        return replace(self, half=self.half - (self.half @ Vt.T * shrunk) @ Vt)

    def nats(self, rows: Array) -> float:
        """The information that rows (m, n) add on what is determined, 1/2 log det(I + A C A')."""
        s = np.linalg.svd(rows @ self.half, compute_uv=False)
        return 0.5 * float(np.sum(np.log1p(s**2)))

    @property
    def sds(self) -> Array:
        """The standard deviation (n,) of each unknown; infinite where a null direction moves it."""
        open_ = np.linalg.norm(self.null, axis=1) > NEGLIGIBLE
        return np.where(open_, np.inf, np.linalg.norm(self.half, axis=1))

    def split(self, gradients: Array) -> tuple[int, Array]:
        """Of quantities with gradients (n, q): how many are open, and a half of the others.

        Combinations of the quantities count, so q - open of them are determined; their covariance
        is K'K, and K (r, q - open) is returned.
        """
        if not self.null.shape[1]:
            return 0, self.half.T @ gradients
        size = np.linalg.norm(gradients)
        _, s, Vt = np.linalg.svd(self.null.T @ gradients)
        rank = int(np.sum(s > NEGLIGIBLE * size))
        return rank, self.half.T @ gradients @ Vt[rank:].T


NEGLIGIBLE = 1e-7  # of a quantity's gradient along null directions: rounding
