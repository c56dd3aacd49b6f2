"""Chains of Hamiltonian Monte Carlo side by side: trajectories, and jumps among modes."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array, Mask
from workbench.sampling.descent import Mode
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import nearest_mode

FRACTION = 0.5  # of the step that a chain takes at least
LONGEST = 64  # leapfrog steps in a trajectory
SOME_INSIDE = 0.1  # of the ends: fewer, and steps are to become shorter whatever the reason
WORTH = 5.0  # successive points of a chain that tell as much of a covariance as a single one


class Chains:
    """Positions u (N, d) with their log densities (N,) and gradients (N, d)."""

    def __init__(self, target: LogDensity, centre: Array, half: Array, u: Array) -> None:
        self._target, self.centre, self.half, self.u = target, centre, half, u
        self.log_p, self.slope = self._at(u)

    @property
    def z(self) -> Array:
        """(N, d) the entries that are sampled."""
        return np.asarray(self.centre + self.u @ self.half.T)

    def _at(self, u: Array) -> tuple[Array, Array]:
        log_p, slope = self._target.with_gradient(self.centre + u @ self.half.T)
        return log_p, slope @ self.half

    def move(self, step: float, length: float, rng: np.random.Generator) -> tuple[float, int]:
        """One trajectory of each chain: the mean chance of acceptance, and its leapfrog steps."""
        N = len(self.u)
        count = int(np.clip(round(length / step), 1, LONGEST))
        e = step * rng.uniform(FRACTION, 1.0, size=(N, 1)) * 2 / (1 + FRACTION)
        p = rng.standard_normal(self.u.shape)
        u, slope, before = self.u, self.slope, self.log_p - 0.5 * np.sum(p**2, axis=1)
        log_p = self.log_p
        with np.errstate(all="ignore"):  # a chain that runs away is rejected
            for _ in range(count):
                p = p + 0.5 * e * slope
                u = u + e * p
                log_p, slope = self._at(u)
                p = p + 0.5 * e * slope
            change = log_p - 0.5 * np.sum(p**2, axis=1) - before
            chance = np.nan_to_num(np.exp(np.minimum(0.0, change)))
        self._take(rng.uniform(size=N) < chance, u, log_p, slope)
        return float(chance[self._counted(u)].mean()), count

    def jump(self, found: Sequence[Mode], rng: np.random.Generator) -> None:
        """Each chain tries to go to the place in another mode that corresponds to its own.

        From mode i to mode j, z becomes z_j + H_j H_i^-1 (z - z_i), with the halves H of Laplace's
        approximation. Both modes are drawn at random, wherever the chain is, and the end is
        accepted with a chance of min(1, ratio of the densities times |H_j| / |H_i|), so that the
        posterior stays what it is.
        """
        N, z = len(self.u), self.z
        i = rng.integers(len(found), size=N)
        j = (i + rng.integers(1, len(found), size=N)) % len(found)
        to, volume = np.empty_like(z), np.empty(N)
        for a, b in sorted({*zip(i.tolist(), j.tolist(), strict=True)}):
            some, here, there = (i == a) & (j == b), found[a], found[b]
            to[some] = there.z + (z[some] - here.z) @ np.linalg.solve(here.half.T, there.half.T)
            volume[some] = np.linalg.slogdet(there.half)[1] - np.linalg.slogdet(here.half)[1]
        u = np.asarray(np.linalg.solve(self.half, (to - self.centre).T).T)
        log_p, slope = self._at(u)
        with np.errstate(invalid="ignore"):
            change = np.nan_to_num(log_p - self.log_p + volume, nan=-np.inf)
        self._take(np.log(rng.uniform(size=N)) < change, u, log_p, slope)

    def _take(self, taken: Mask, u: Array, log_p: Array, slope: Array) -> None:
        self.u = np.where(taken[:, None], u, self.u)
        self.log_p = np.where(taken, log_p, self.log_p)
        self.slope = np.where(taken[:, None], slope, self.slope)

    def _counted(self, u: Array) -> Mask:
        """Which ends say whether steps are short enough: not those that only a bound refuses."""
        problem = self._target.problem
        everywhere = np.ones(len(u), dtype=bool)
        if not problem.bounded and problem.stacked_constraints is None:
            return everywhere
        z = self.centre + u @ self.half.T
        inside = self._target.allows(self._target.subspace.points(z))
        return inside if inside.mean() > SOME_INSIDE else everywhere

    def whitened(self, seen: Array, found: Sequence[Mode]) -> "Chains":
        """The same chains in coordinates in which the points seen (M, d) have covariance 1.

        The covariance is that around the mean of each mode: how far modes are from each other says
        nothing of how long a step can be in any of them. The fewer points there are, the more of
        the covariance is taken from the coordinates as they are.
        """
        d, worth = seen.shape[1], len(seen) / WORTH
        mean = seen.mean(axis=0)
        if len(found) > 1:
            which = nearest_mode(found, self.centre + seen @ self.half.T)
            means = {i: seen[which == i].mean(axis=0) for i in set(which.tolist())}
            seen = seen - np.array([means[i] for i in which.tolist()])
        known = worth / (worth + d)
        root = np.linalg.cholesky(known * np.cov(seen.T).reshape(d, d) + (1 - known) * np.eye(d))
        u = np.linalg.solve(root, (self.u - mean).T).T
        return Chains(self._target, self.centre + self.half @ mean, self.half @ root, u)
