r"""Hamiltonian Monte Carlo with many chains side by side: for more numbers than ensembles sample.

A chain at u draws a momentum p ~ N(0, 1) and follows Hamilton's equations of

    H(u, p) = -log density(u) + p'p / 2

by leapfrog steps; its end is accepted with a chance of min(1, exp(-change of H)) (Duane et al.
1987, Hybrid Monte Carlo; Neal 2011, MCMC using Hamiltonian dynamics). Gradients carry a chain far
along a bent ridge of many dimensions, where proposals of ensembles are hardly ever accepted.

Steps are taken in u, with x = centre + half u. `half` is first that of Laplace's approximation, and
after half of the warm-up a square root of the covariance of all chains, each about the mean of the
chains at the same mode. The step is adapted during the warm-up until 95 % of the ends are accepted:
with a longer one chains would hardly ever leave the narrow places of a bent ridge. Each chain takes
a random fraction of the step, and trajectories have random lengths, so that none returns to where
it began. Where several modes are known, each trajectory is followed by an attempt to jump from one
mode to another (Pompe, Holmes and Latuszynski 2020, A framework for adaptive MCMC targeting
multimodal distributions). An end beyond bounds or constraints is refused.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array, Mask
from workbench.interrupts import Interrupts
from workbench.sampling.ensembles import (
    Callback,
    SamplerSettings,
    SamplingProgress,
    asks_to_stop,
    without_burn_in,
)
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import TIMES, Mixing
from workbench.sampling.modes import Mode, nearest_mode
from workbench.threads import limited_threads

FRACTION = 0.5  # of the step that a chain takes at least
LONGEST = 64  # leapfrog steps in a trajectory
SOME_INSIDE = 0.1  # of the ends: fewer, and steps are to become shorter whatever the reason
WARM = 60  # trajectories of the warm-up
SETTLING = 5  # of them with the step that stays
FIRST = 0.1  # step at the beginning, in standard deviations of Laplace's approximation
LEAST, MOST = 1e-3, 1.5  # of a step
ACCEPTED = 0.95  # of the ends: for evenly wide densities 0.65 to 0.9 (Betancourt et al. 2014)
GAIN = 0.3  # by which the log of the step follows the acceptance
LENGTH = (0.2 * np.pi, np.pi)  # of trajectories; pi / 2 makes an end of a Gaussian forget its start
CHECKED = 150  # trajectories after which draws are judged first; then after 2, 4, ... times as many
FEWEST = 20  # trajectories after the warm-up, whatever the number of steps
EVERY = 10  # trajectories whose ends are kept with all numbers: one
WORTH = 5.0  # successive points of a chain that tell as much of a covariance as a single one


class Chains:
    """Chains at u (N, d), z = centre + half u; their log densities (N,), and gradients (N, d)."""

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

        The covariance is that around the mean of each mode. The fewer points there are, the more of
        it is taken from the coordinates as they are.
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


@dataclass(frozen=True, eq=False)
class HamiltonianRun:
    """What a run has drawn."""

    mixing: Mixing  # the draws (E, S, W, k) of what is judged, and what is known of them
    log_prob: Array  # (E, S, W) their log densities
    points: Array  # (R, n) every tenth of the points, with all free numbers
    seconds: float  # how long the run took
    interrupted: bool  # whether it was stopped early


def adapted(step: float, chance: float, wanted: float) -> float:
    """The next step, after one with which this share of the ends was accepted."""
    return float(np.clip(step * np.exp(GAIN * (chance - wanted)), LEAST, MOST))


def run_hamiltonian(
    target: LogDensity,
    starts: Array,
    found: Sequence[Mode],
    judged: Callable[[Array], Array],
    labels: tuple[str, ...],
    plan: SamplerSettings,
    rng: np.random.Generator,
    callback: Callback = None,
) -> HamiltonianRun:
    """Draw from the target, beginning at `starts` (E W, d), until what is judged is usable.

    `found` are modes, at which the starts are by their shares; the `half` of the first is the first
    unit of steps. Where there are several, chains also try to jump among them. `judged` takes
    points of all entries (N, d) to what the verdict is on, (N, k), whose names are `labels`. An
    interrupt from the keyboard, or a callback that returns True, ends the run; draws after the
    warm-up are kept.
    """
    began = time.perf_counter()
    centre, half = starts.mean(axis=0), found[0].half
    chains = Chains(target, centre, half, np.linalg.solve(half, (starts - centre).T).T)
    kept = _Kept(plan, labels)
    history: list[Array] = []
    steps, step, stopped = 0, FIRST, False
    with limited_threads(), Interrupts() as interrupts:
        try:
            while kept.count < FEWEST or not (steps >= plan.steps or kept.enough):
                interrupts.check()
                chance, count = chains.move(step, float(rng.uniform(*LENGTH)), rng)
                steps += count
                if len(found) > 1:
                    chains.jump(found, rng)
                if len(history) < WARM:
                    if len(history) < WARM - SETTLING:
                        step = adapted(step, chance, ACCEPTED)
                    history.append(chains.u)
                    if len(history) == WARM // 2:
                        seen = np.concatenate(history[-WARM // 4 :])
                        chains, step = chains.whitened(seen, found), FIRST
                    kept.warm = steps
                else:
                    kept.add(judged(chains.z), chains.log_p, chance, steps)
                    if kept.count % EVERY == 1:
                        kept.points.append(target.subspace.points(chains.z))
                if callback is not None:
                    taken = min(steps, plan.steps)  # the last trajectory may lead beyond
                    seconds = time.perf_counter() - began
                    with interrupts.raised_at_once():
                        progress = SamplingProgress(
                            taken, plan.steps, chance, seconds, all_free=True
                        )
                        stopped = asks_to_stop(callback(progress))
                    if stopped:
                        break
        except KeyboardInterrupt:
            stopped = True
    if not kept.count:
        raise KeyboardInterrupt  # before there was anything to keep
    mixing = kept.mixing
    log_prob = kept.log_prob[:, -mixing.draws.shape[1] :]
    seconds = time.perf_counter() - began
    return HamiltonianRun(mixing, log_prob, np.concatenate(kept.points), seconds, stopped)


class _Kept:
    """What is kept of a run after its warm-up of `warm` leapfrog steps."""

    def __init__(self, plan: SamplerSettings, labels: tuple[str, ...]) -> None:
        self._plan, self._labels, self._goal = plan, labels, CHECKED
        self._z: list[Array] = []
        self._log_p: list[Array] = []
        self._chances, self._steps = 0.0, 0
        self.warm, self.points = 0, list[Array]()

    @property
    def count(self) -> int:
        """How many trajectories are kept."""
        return len(self._z)

    def add(self, z: Array, log_p: Array, chance: float, steps: int) -> None:
        """The ends of a trajectory (N, k); `steps` were taken by now, the warm-up included."""
        self._z.append(z)
        self._log_p.append(log_p)
        self._chances += chance
        self._steps = steps

    @property
    def enough(self) -> bool:
        """Whether the draws are usable; judged now and then."""
        if self._plan.whole or self.count < self._goal:
            return False
        self._goal *= 2
        mixing = self.mixing
        return mixing.usable and mixing.length >= TIMES

    @property
    def mixing(self) -> Mixing:
        """The draws without burn-in, and what is known of them."""
        taken = max(1, round((self._steps - self.warm) / self.count))
        acceptance = self._chances / self.count
        found = without_burn_in(self._by_ensemble(self._z), taken, acceptance, self._labels)
        return replace(found, discarded=found.discarded + self.warm, proposals=1)

    @property
    def log_prob(self) -> Array:
        """(E, S, W) the log densities."""
        return self._by_ensemble(self._log_p)

    def _by_ensemble(self, each: list[Array]) -> Array:
        shape = self.count, self._plan.ensembles, self._plan.walkers, *each[0].shape[1:]
        return np.stack(each).reshape(shape).swapaxes(0, 1)
