"""Whether a Gaussian that stands for a posterior holds: importance weights, or draws beside it.

Draws come from a density q and should come from p. The tail of the weights p / q is fitted by a
generalised Pareto distribution, whose shape k-hat says how many moments they have: below 0.5 few
draws are lost, above 0.7 none of it can be trusted (Vehtari et al. 2024, Pareto smoothed importance
sampling). Where k-hat is small, the weighted draws also say how far the quantiles of q are off.

These weights are of all free numbers together. With many of them k-hat is large although the
marginal of what is named is right, because small misfits of many numbers multiply. `compared`
therefore judges the named entries by draws of all free numbers from the posterior itself.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.environment import optional_library
from workbench.sampling.log_density import LogDensity

WEIGHED = 4000  # draws
MOST_K_HAT = 0.7
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
MOST_ERROR = 0.05  # of a quantile's level, and of the draws that bounds and constraints forbid
MOST_WIDER = 0.1  # of the width of an interval of 90 %
SURE_SHARE = 0.4  # of all of these limits: no closer look is needed


@dataclass(frozen=True, eq=False)
class Importance:
    """k-hat, how many draws out of `tried` the weights leave, and what the weights correct."""

    k_hat: float  # the shape of the Pareto distribution fitted to the largest weights
    effective: float  # the effective number of draws
    tried: int  # the number of draws
    # the share of the draws that bounds, constraints or domains of residuals forbid
    outside: float = 0.0
    cut_off: float = 0.0  # the share of what constraints allow that the Gaussian leaves out
    # (k,) the largest correction of a quantile's level of each entry: 0.02 if the 5 % quantile
    # holds 7 %
    errors: Array = field(default_factory=lambda: np.zeros(1))
    # (k,) the corrected width of the interval of 90 % of each entry, over its width
    widths: Array = field(default_factory=lambda: np.ones(1))
    labels: tuple[str, ...] = ("",)  # the entries
    what: str = "the Gaussian conditional of the rest"  # the name of the approximation
    remedy: str = "sample more of it, or fix it"  # what to do if it does not hold
    beside: str = ""  # what the entries were compared with; empty if the weights themselves tell

    def of_entries(self, places: Index) -> "Importance":
        """The same of some entries (m,)."""
        labels = tuple(self.labels[i] for i in places)
        return replace(self, errors=self.errors[places], widths=self.widths[places], labels=labels)

    @property
    def error(self) -> float:
        """The largest correction of a quantile's level."""
        return float(self.errors.max())

    @property
    def worst(self) -> str:
        """The entry with the largest correction, measured by what is allowed."""
        wider = abs(self.widths - 1)
        return self.labels[int(np.argmax(np.maximum(self.errors / MOST_ERROR, wider / MOST_WIDER)))]

    @property
    def holds(self) -> bool:
        """Whether the approximation serves for the intervals of the entries.

        Errors and both shares are at most 0.05, and widths are off by at most 10 %. Unless the
        entries were compared with draws of the posterior, k-hat is at most 0.7.
        """
        return self._within(1.0)

    @property
    def surely(self) -> bool:
        """Whether it holds with so much to spare that no closer look is needed."""
        return self._within(SURE_SHARE)

    def _within(self, share: float) -> bool:
        wider = float(abs(self.widths - 1).max())
        error = max(self.error, self.outside, self.cut_off)
        known = bool(self.beside) or self.k_hat <= MOST_K_HAT
        return known and error <= share * MOST_ERROR and wider <= share * MOST_WIDER

    def __str__(self) -> str:
        parts = [
            f"importance weights leave {self.effective / self.tried:.0%} of the draws effective"
        ]
        if self.outside:
            parts.append(f"{self.outside:.1%} of the draws outside bounds or constraints")
        if self.cut_off:
            parts.append(
                f"constraints, taken as linear, cut off {self.cut_off:.0%} of what they allow"
            )
        wider = float(abs(self.widths - 1).max())
        entry = "" if self.error <= MOST_ERROR and wider <= MOST_WIDER else f", {self.worst}"
        errors = f"quantiles off by {self.error:.3f} and widths by {wider:.0%} at most{entry}"
        if self.beside:
            text = f"(compared with {self.beside}: {errors}; of all free numbers together "
            text += f"k-hat is {self.k_hat:.2f}, with {'; '.join(parts)})"
        elif self.k_hat <= MOST_K_HAT:
            text = f"(k-hat {self.k_hat:.2f}; {'; '.join([*parts, errors])})"
        else:
            text = f"(k-hat {self.k_hat:.2f}, above {MOST_K_HAT}; {'; '.join(parts)})"
        if self.holds:
            return f"{self.what} holds {text}"
        return f"{self.what} does not hold {text}; {self.remedy}"


def of_the_rest(target: LogDensity, flat: Array, rng: np.random.Generator) -> Importance | None:
    """The importance weights of draws z (N, k) with w ~ N(0, 1); None if there is no w."""
    count = target.subspace.rest.shape[1]
    if not count:
        return None
    z = flat[rng.integers(len(flat), size=WEIGHED)]
    return _weighed(target, z, target(z), rng)


def of_laplace(
    target: LogDensity, z: Array, log_q: Array, cut_off: float, rng: np.random.Generator
) -> Importance:
    """The importance weights of draws z (N, k) of a Gaussian with log density `log_q` (N,)."""
    every = max(1, len(z) // WEIGHED)
    return replace(
        _weighed(target, z[::every], log_q[::every], rng),
        cut_off=cut_off,
        what="Laplace's Gaussian",
        remedy="draw from the posterior itself with `sample`",
    )


def compared(importance: Importance, z: Array, draws: Array, beside: str) -> Importance:
    """The approximation with draws z (N, k), beside draws (M, k) of the posterior itself."""
    quantiles = np.quantile(z, LEVELS, axis=0)
    levels = np.array([np.mean(z <= quantile, axis=0) for quantile in quantiles])
    right_levels = np.array([np.mean(draws <= quantile, axis=0) for quantile in quantiles])
    right = np.quantile(draws, LEVELS, axis=0)
    return replace(
        importance,
        errors=abs(right_levels - levels).max(axis=0),
        widths=(right[-1] - right[0]) / (quantiles[-1] - quantiles[0]),
        beside=beside,
    )


def _weighed(target: LogDensity, z: Array, log_q: Array, rng: np.random.Generator) -> Importance:
    space = target.subspace
    w = rng.standard_normal((len(z), space.rest.shape[1]))
    x = space.points(z, w)
    log_p = target.at(x)
    log_weights = log_p - log_q + 0.5 * np.sum(w**2, axis=1)
    smoothed, k_hat = psis(log_weights)
    if np.isfinite(smoothed).any():
        weights = np.exp(smoothed - smoothed.max())
        effective = float(weights.sum() ** 2 / np.sum(weights**2))
    else:  # no draw has a weight: none is corrected, and none counts
        weights, effective = np.ones(len(z)), 0.0
    allowed = target.allows(x)
    if target.problem.domain is not None:
        allowed &= np.isfinite(log_p)
    outside = 1 - float(allowed.mean())
    weights /= weights.sum()
    quantiles = np.quantile(z, LEVELS, axis=0)
    below = quantiles[:, None, :] > z  # (levels, N, k)
    errors = np.abs(np.einsum("n,lnk->lk", weights, below) - below.mean(axis=1)).max(axis=0)
    right, before = (
        np.array([np.ptp(_weighted_quantiles(column, each)) for column in z.T])
        for each in (weights, np.full(len(z), 1 / len(z)))
    )
    return Importance(
        k_hat,
        effective,
        len(z),
        outside,
        errors=errors,
        widths=right / before,
        labels=space.labels,
    )


def psis(log_weights: Array) -> tuple[Array, float]:
    """Pareto-smoothed log weights (N,), and k-hat.

    Infinite, and the weights as they are, where too few or too equal ones make the tail.
    Raises MissingLibrary where arviz-stats is not installed.
    """
    finite = np.isfinite(log_weights)
    if finite.sum() < 20:
        return np.full_like(log_weights, -np.inf), np.inf
    kept = np.where(finite, log_weights, log_weights[finite].min() - 1e3)
    if np.ptp(kept) < 1e-9:
        return kept, -np.inf
    stats = optional_library("arviz_stats.base", "smoothing importance weights").array_stats
    try:
        with np.errstate(all="ignore"):
            smoothed, k_hat = stats.psislw(-kept)
    except ValueError:  # all of the tail is equal
        return kept, np.inf
    return (smoothed, float(k_hat)) if np.isfinite(smoothed).all() else (kept, np.inf)


def _weighted_quantiles(draws: Array, weights: Array) -> Array:
    """The 5 % and the 95 % quantile of draws (N,) with weights (N,) that sum to one: (2,)."""
    order = np.argsort(draws)
    level = np.cumsum(weights[order]) - 0.5 * weights[order]
    return np.interp([LEVELS[0], LEVELS[-1]], level, draws[order])
