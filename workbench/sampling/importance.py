"""Whether the Gaussian conditional of what was integrated out holds: importance weights.

Draws come from q(z, w) = p(x(z, 0)) N(w; 0, 1) / Z, and should come from p(x(z, w)). The tail of
the weights p / q is fitted by a generalised Pareto distribution, whose shape k-hat says how many
moments they have: below 0.5 few draws are lost, above 0.7 none of it can be trusted (Vehtari et
al. 2024, Pareto smoothed importance sampling).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.sampling.arviz_quietly import psis
from workbench.sampling.target import Target

Array = NDArray[np.float64]
TRIED = 4000
HOLDS = 0.7


@dataclass(frozen=True)
class Importance:
    """k-hat, and how many draws out of `tried` the weights leave."""

    k_hat: float
    effective: float
    tried: int

    @property
    def holds(self) -> bool:
        """Whether k-hat is at most 0.7."""
        return self.k_hat <= HOLDS

    def __str__(self) -> str:
        share = f"{self.effective / self.tried:.0%} of the draws left by importance weights"
        if self.holds:
            return f"The Gaussian conditional of the rest holds (k-hat {self.k_hat:.2f}; {share})"
        return (
            f"NOT CONVERGED: the Gaussian conditional of the rest does not hold (k-hat "
            f"{self.k_hat:.2f}, above {HOLDS}; {share}); sample more of it, or fix it"
        )


def importance(target: Target, flat: Array, rng: np.random.Generator) -> Importance | None:
    """Of draws z (N, k); None where nothing was integrated out."""
    count = target.subspace.rest.shape[1]
    if not count:
        return None
    z = flat[rng.integers(len(flat), size=TRIED)]
    w = rng.standard_normal((TRIED, count))
    space = target.subspace
    log_weights = target.at(space.points(z, w)) - target(z) + 0.5 * np.sum(w**2, axis=1)
    smoothed, k_hat = psis(log_weights)
    weights = np.exp(smoothed - smoothed.max())
    return Importance(k_hat, float(weights.sum() ** 2 / np.sum(weights**2)), TRIED)
