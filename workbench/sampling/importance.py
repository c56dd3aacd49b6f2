"""Whether a Gaussian that stands for a posterior holds: importance weights.

Draws come from a density q and should come from p. The tail of the weights p / q is fitted by a
generalised Pareto distribution, whose shape k-hat says how many moments they have: below 0.5 few
draws are lost, above 0.7 none of it can be trusted (Vehtari et al. 2024, Pareto smoothed importance
sampling). Where k-hat is small, the weighted draws also say how far the quantiles of q are off.
"""

from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.sampling.arviz_interface import psis
from workbench.sampling.log_density import LogDensity

TRIED = 4000
HOLDS = 0.7
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
OFF = 0.05  # of a quantile's level, and of the draws that bounds and constraints forbid


@dataclass(frozen=True)
class Importance:
    """k-hat, how many draws out of `tried` the weights leave, and what the weights correct.

    Attributes:
        k_hat: the shape of the Pareto distribution fitted to the largest weights.
        effective: the effective number of draws.
        tried: the number of draws.
        outside: the share of the draws that bounds or constraints forbid.
        cut_off: the share of what constraints allow that the Gaussian leaves out.
        error: the largest correction of a quantile's level: 0.02 if the 5 % quantile holds 7 %.
        worst: the entry with that correction.
        what: the name of the approximation.
        remedy: what to do if it does not hold.
    """

    k_hat: float
    effective: float
    tried: int
    outside: float = 0.0
    cut_off: float = 0.0
    error: float = 0.0
    worst: str = ""
    what: str = "the Gaussian conditional of the rest"
    remedy: str = "sample more of it, or fix it"

    @property
    def holds(self) -> bool:
        """Whether k-hat is at most 0.7, and errors and both shares at most 0.05."""
        return self.k_hat <= HOLDS and max(self.error, self.outside, self.cut_off) <= OFF

    def __str__(self) -> str:
        told = [f"{self.effective / self.tried:.0%} of the draws left by importance weights"]
        if self.outside:
            told.append(f"{self.outside:.1%} of the draws outside bounds or constraints")
        if self.cut_off:
            told.append(
                f"constraints, taken as linear, cut off {self.cut_off:.0%} of what they allow"
            )
        if self.k_hat <= HOLDS:
            entry = f", {self.worst}" if self.error > OFF else ""
            told.append(f"quantiles off by {self.error:.3f} at most{entry}")
        limit = f", above {HOLDS}" if self.k_hat > HOLDS else ""
        said = f"(k-hat {self.k_hat:.2f}{limit}; {'; '.join(told)})"
        if self.holds:
            return f"{self.what} holds {said}"
        return f"{self.what} does not hold {said}; {self.remedy}"


def of_the_rest(target: LogDensity, flat: Array, rng: np.random.Generator) -> Importance | None:
    """The importance weights of draws z (N, k) with w ~ N(0, 1); None if there is no w."""
    count = target.subspace.rest.shape[1]
    if not count:
        return None
    z = flat[rng.integers(len(flat), size=TRIED)]
    return _weighed(target, z, target(z), rng, Importance(np.inf, 0.0, TRIED))


def of_laplace(
    target: LogDensity, z: Array, log_q: Array, cut_off: float, rng: np.random.Generator
) -> Importance:
    """The importance weights of draws z (N, k) of a Gaussian with log density `log_q` (N,)."""
    every = max(1, len(z) // TRIED)
    z, log_q = z[::every], log_q[::every]
    told = Importance(
        np.inf,
        0.0,
        len(z),
        cut_off=cut_off,
        what="Laplace's Gaussian",
        remedy="draw from the posterior itself with `sample`",
    )
    return _weighed(target, z, log_q, rng, told)


def _weighed(
    target: LogDensity, z: Array, log_q: Array, rng: np.random.Generator, told: Importance
) -> Importance:
    space = target.subspace
    w = rng.standard_normal((len(z), space.rest.shape[1]))
    x = space.points(z, w)
    log_weights = target.at(x) - log_q + 0.5 * np.sum(w**2, axis=1)
    smoothed, k_hat = psis(log_weights)
    weights = np.exp(smoothed - smoothed.max()) if np.isfinite(smoothed).any() else 0 * smoothed
    if not weights.sum() > 0:
        weights = np.ones(len(z))
    outside = 1 - float(target.allows(x).mean())
    weights /= weights.sum()
    below = np.quantile(z, LEVELS, axis=0)[:, None, :] > z  # (levels, N, k)
    errors = np.abs(np.einsum("n,lnk->lk", weights, below) - below.mean(axis=1)).max(axis=0)
    worst = int(np.argmax(errors))
    return replace(
        told,
        k_hat=k_hat,
        effective=1 / float(np.sum(weights**2)),
        outside=outside,
        error=float(errors[worst]),
        worst=space.labels[worst],
    )
