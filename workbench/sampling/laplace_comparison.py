"""Laplace's approximation beside the draws: where they agree, and where the posterior is curved."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.sampling.posterior import Posterior

SHIFTED = 0.3  # of Laplace's standard deviation
WIDER, NARROWER = 1.15, 0.87  # standard deviation over Laplace's
SKEWED = 0.5  # third moment over the cube of the standard deviation
VALLEY = 0.7  # of the lower of two peaks: deeper ones part two modes
SEEN = 0.1  # of the higher peak: lower ones are noise


@dataclass(frozen=True)
class EntryComparison:
    """One entry; shift in Laplace's standard deviations, ratio of the standard deviations."""

    label: str
    unit: str
    mean: float
    sd: float
    shift: float
    ratio: float
    skewness: float
    peaks: int

    @property
    def remark(self) -> str:
        """How the draws differ from Laplace's approximation."""
        if self.peaks > 1:
            return f"{self.peaks} modes"
        found = []
        if abs(self.shift) > SHIFTED:
            found.append("shifted")
        if self.ratio > WIDER:
            found.append("wider")
        if self.ratio < NARROWER:
            found.append("narrower")
        if abs(self.skewness) > SKEWED:
            found.append("curved")
        return ", ".join(found) or "agrees"


def compared_with_laplace(
    posterior: Posterior, approximation: Posterior
) -> tuple[EntryComparison, ...]:
    """Entry by entry. Raises BadArgument if the two are not of the same entries."""
    if posterior.labels != approximation.labels:
        raise BadArgument(
            "the two posteriors are of different entries; give `laplace` the same names and rest"
        )
    shift = (posterior.mean - approximation.mean) / approximation.sd
    ratio = posterior.sd / approximation.sd
    from scipy.stats import skew  # a second to import: not before it is needed

    skewness = np.asarray(skew(posterior.flat, axis=0))
    return tuple(
        EntryComparison(
            posterior.labels[i],
            posterior.units[i],
            float(posterior.mean[i]),
            float(posterior.sd[i]),
            float(shift[i]),
            float(ratio[i]),
            float(skewness[i]),
            peaks(posterior.flat[:, i]),
        )
        for i in range(posterior.size)
    )


def peaks(draws: Array) -> int:
    """How many modes a smooth density of the draws (N,) has, valleys between them deep enough."""
    from scipy.stats import gaussian_kde

    some = draws[:: max(1, len(draws) // 4000)]
    if np.ptp(some) == 0:
        return 1
    low, high = np.quantile(some, [0.001, 0.999])
    grid = np.linspace(low, high, 200)
    density = gaussian_kde(some, bw_method=1.3 * len(some) ** -0.2)(grid)
    tops = [
        i
        for i in range(1, 199)
        if density[i - 1] < density[i] >= density[i + 1] and density[i] > SEEN * density.max()
    ]
    count = min(1, len(tops))
    for i, j in pairwise(tops):
        if density[i:j].min() < VALLEY * min(density[i], density[j]):
            count += 1
    return max(1, count)
