"""Where searches for other modes begin: far and near, on all sides, where the cost is low."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.arrays import Array
from workbench.sampling.descent import Mode, bounds_of
from workbench.sampling.log_density import LogDensity

REACH = (3.0, 1000.0)  # standard deviations of Laplace's approximation that starts are away
SHELLS = 8  # of distances, in equal ratios
TRIED = 128  # points in each of them


@dataclass(frozen=True)
class SearchExtent:
    """How widely other modes were looked for.

    Attributes:
        starts: how many searches there were.
        farthest: the largest distance of a start, in Laplace's standard deviations.
        boxed: how many entries have two bounds, over which starts were spread as well.
    """

    starts: int
    farthest: float
    boxed: int

    def __str__(self) -> str:
        if not self.starts:
            return "no other modes were looked for"
        said = f"{self.starts} searches for other modes, up to {self.farthest:,.0f} sd away"
        entries = "entry" if self.boxed == 1 else "entries"
        return said + (f" and all over the bounds of {self.boxed} {entries}" if self.boxed else "")


def wide_starts(
    target: LogDensity, first: Mode, rng: np.random.Generator
) -> tuple[list[Array], SearchExtent]:
    """Starts (k,) for searches, and how far they reach.

    Each shell of distances gives two starts: of many random points the one with the least cost, and
    the one with the least cost on the other side of the first mode. Half of the points move all
    entries, the other half a single entry and those that are correlated with it. If entries have
    two bounds, two more starts come from points everywhere between these. Points without a density
    are left out.
    """
    k = target.subspace.size
    low, high = bounds_of(target)
    edges = np.geomspace(*REACH, SHELLS + 1)
    covariance = first.half @ first.half.T
    alone = covariance / np.sqrt(np.diag(covariance))  # columns: one entry by 1 sd, all along
    found: list[Array] = []
    farthest = 0.0
    for near, far in pairwise(edges):
        distance = near * (far / near) ** rng.uniform(size=(TRIED, 1))
        way = rng.standard_normal((TRIED, k)) @ first.half.T
        single = rng.integers(k, size=TRIED // 2)
        way[::2] = rng.choice([-1.0, 1.0], size=(TRIED // 2, 1)) * alone[:, single].T
        z = np.clip(first.z + distance * way, low, high)
        chosen = _lowest(target, first, z)
        if chosen:
            farthest = far
        found += chosen
    two_sided = np.isfinite(high - low) & (high > low)
    if two_sided.any():
        z = first.z + REACH[0] * rng.standard_normal((TRIED, k)) @ first.half.T
        share = rng.uniform(size=(TRIED, int(two_sided.sum())))
        z[:, two_sided] = low[two_sided] + share * (high - low)[two_sided]
        found += _lowest(target, first, np.clip(z, low, high))
    return found, SearchExtent(len(found), farthest, int(two_sided.sum()))


def _lowest(target: LogDensity, first: Mode, z: Array) -> list[Array]:
    """The point of least cost among z (M, k), and that on the other side of the first mode."""
    value = target(z)
    known = np.isfinite(value)
    if not known.any():
        return []
    best = int(np.argmax(value))
    ways = np.linalg.solve(first.half, (z - first.z).T).T
    other = known & (ways @ ways[best] < 0)
    if not other.any():
        return [z[best]]
    return [z[best], z[int(np.argmax(np.where(other, value, -np.inf)))]]
