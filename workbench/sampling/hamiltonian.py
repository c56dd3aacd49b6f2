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
from workbench.sampling.mixing import LONG_TIMES, Mixing
from workbench.sampling.modes import Mode, nearest_mode
from workbench.threads import limited_threads

LEAST_FRACTION = 0.5  # of the step that a chain takes
MOST_LEAPFROG_STEPS = 64  # in a trajectory
SOME_INSIDE = 0.1  # of the ends: fewer, and steps are to become shorter whatever the reason
WARM_UP = 60  # trajectories
SETTLING = 5  # of them with the step that stays
FIRST_STEP = 0.1  # in standard deviations of Laplace's approximation
LEAST_STEP, MOST_STEP = 1e-3, 1.5
ACCEPTED_SHARE = 0.95  # of the ends: for evenly wide densities 0.65 to 0.9 (Betancourt et al. 2014)
GAIN = 0.3  # by which the log of the step follows the acceptance
TRAJECTORY_LENGTH = (0.2 * np.pi, np.pi)  # at pi / 2 an end of a Gaussian forgets its start
FIRST_CHECK = 150  # trajectories after which draws are judged; then after 2, 4, ... times as many
LEAST_TRAJECTORIES = 20  # after the warm-up, whatever the number of steps
POINTS_EVERY = 10  # trajectories whose ends are kept with all numbers: one
POINTS_WORTH_ONE = 5.0  # successive points of a chain tell as much of a covariance as one alone


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
        count = int(np.clip(round(length / step), 1, MOST_LEAPFROG_STEPS))
        e = step * rng.uniform(LEAST_FRACTION, 1.0, size=(N, 1)) * 2 / (1 + LEAST_FRACTION)
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
        self._move_to(rng.uniform(size=N) < chance, u, log_p, slope)
        return float(chance[self._counted(u)].mean()), count

    def jump(self, minima: Sequence[Mode], rng: np.random.Generator) -> None:
        """Each chain tries to go to the place in another mode that corresponds to its own.

        From mode i to mode j, z becomes z_j + H_j H_i^-1 (z - z_i), with the halves H of Laplace's
        approximation. Both modes are drawn at random, wherever the chain is, and the end is
        accepted with a chance of min(1, ratio of the densities times |H_j| / |H_i|), so that the
        posterior stays what it is.
        """
        N, z = len(self.u), self.z
        i = rng.integers(len(minima), size=N)
        j = (i + rng.integers(1, len(minima), size=N)) % len(minima)
        ends, log_volume = np.empty_like(z), np.empty(N)
        for a, b in sorted({*zip(i.tolist(), j.tolist(), strict=True)}):
            jumping, start, end = (i == a) & (j == b), minima[a], minima[b]
            turned = np.linalg.solve(start.half.T, end.half.T)
            ends[jumping] = end.z + (z[jumping] - start.z) @ turned
            log_dets = [np.linalg.slogdet(mode.half)[1] for mode in (start, end)]
            log_volume[jumping] = log_dets[1] - log_dets[0]
        u = np.asarray(np.linalg.solve(self.half, (ends - self.centre).T).T)
        log_p, slope = self._at(u)
        with np.errstate(invalid="ignore"):
            change = np.nan_to_num(log_p - self.log_p + log_volume, nan=-np.inf)
        self._move_to(np.log(rng.uniform(size=N)) < change, u, log_p, slope)

    def _move_to(self, accepted: Mask, u: Array, log_p: Array, slope: Array) -> None:
        self.u = np.where(accepted[:, None], u, self.u)
        self.log_p = np.where(accepted, log_p, self.log_p)
        self.slope = np.where(accepted[:, None], slope, self.slope)

    def _counted(self, u: Array) -> Mask:
        """Which ends say whether steps are short enough: not those that only a bound refuses."""
        problem = self._target.problem
        everywhere = np.ones(len(u), dtype=bool)
        if not problem.bounded and problem.stacked_constraints is None:
            return everywhere
        z = self.centre + u @ self.half.T
        inside = self._target.allows(self._target.subspace.points(z))
        return inside if inside.mean() > SOME_INSIDE else everywhere

    def whitened(self, points: Array, minima: Sequence[Mode]) -> "Chains":
        """The same chains in coordinates in which these points u (M, d) have the covariance 1.

        The covariance is that around the mean of each mode. The fewer points there are, the more of
        it is taken from the coordinates as they are.
        """
        d, independent = points.shape[1], len(points) / POINTS_WORTH_ONE
        mean = points.mean(axis=0)
        if len(minima) > 1:
            nearest = nearest_mode(minima, self.centre + points @ self.half.T)
            means = {i: points[nearest == i].mean(axis=0) for i in set(nearest.tolist())}
            points = points - np.array([means[i] for i in nearest.tolist()])
        known = independent / (independent + d)
        root = np.linalg.cholesky(known * np.cov(points.T).reshape(d, d) + (1 - known) * np.eye(d))
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


def adapted(step: float, chance: float, target_chance: float) -> float:
    """The next step, after one with which this share of the ends was accepted."""
    return float(np.clip(step * np.exp(GAIN * (chance - target_chance)), LEAST_STEP, MOST_STEP))


def run_hamiltonian(
    target: LogDensity,
    starts: Array,
    minima: Sequence[Mode],
    judged: Callable[[Array], Array],
    labels: tuple[str, ...],
    plan: SamplerSettings,
    rng: np.random.Generator,
    callback: Callback = None,
) -> HamiltonianRun:
    """Draw from the target, beginning at `starts` (E W, d), until what is judged is usable.

    `minima` are modes, at which the starts are by their shares; the `half` of the first is the
    first unit of steps. Where there are several, chains also try to jump among them. `judged` takes
    points of all entries (N, d) to what the verdict is on, (N, k), whose names are `labels`. An
    interrupt from the keyboard, or a callback that returns True, ends the run; draws after the
    warm-up are kept.
    """
    began = time.perf_counter()
    centre, half = starts.mean(axis=0), minima[0].half
    chains = Chains(target, centre, half, np.linalg.solve(half, (starts - centre).T).T)
    kept = _Kept(plan, labels)
    history: list[Array] = []
    steps, step, stopped = 0, FIRST_STEP, False
    with limited_threads(), Interrupts() as interrupts:
        try:
            while kept.count < LEAST_TRAJECTORIES or not (steps >= plan.steps or kept.enough):
                interrupts.check()
                chance, count = chains.move(step, float(rng.uniform(*TRAJECTORY_LENGTH)), rng)
                steps += count
                if len(minima) > 1:
                    chains.jump(minima, rng)
                if len(history) < WARM_UP:
                    if len(history) < WARM_UP - SETTLING:
                        step = adapted(step, chance, ACCEPTED_SHARE)
                    history.append(chains.u)
                    if len(history) == WARM_UP // 2:
                        latest = np.concatenate(history[-WARM_UP // 4 :])
                        chains, step = chains.whitened(latest, minima), FIRST_STEP
                    kept.warm = steps
                else:
                    kept.add(judged(chains.z), chains.log_p, chance, steps)
                    if kept.count % POINTS_EVERY == 1:
                        kept.points.append(target.subspace.points(chains.z))
                if callback is not None:
                    done = min(steps, plan.steps)  # the last trajectory may lead beyond
                    seconds = time.perf_counter() - began
                    with interrupts.raised_at_once():
                        progress = SamplingProgress(done, plan.steps, chance, seconds, True)
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
        self._plan, self._labels, self._goal = plan, labels, FIRST_CHECK
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
        return mixing.usable and mixing.length >= LONG_TIMES

    @property
    def mixing(self) -> Mixing:
        """The draws without burn-in, and what is known of them."""
        thin = max(1, round((self._steps - self.warm) / self.count))
        acceptance = self._chances / self.count
        mixing = without_burn_in(self._by_ensemble(self._z), thin, acceptance, self._labels)
        return replace(mixing, discarded=mixing.discarded + self.warm, proposals=1)

    @property
    def log_prob(self) -> Array:
        """(E, S, W) the log densities."""
        return self._by_ensemble(self._log_p)

    def _by_ensemble(self, each: list[Array]) -> Array:
        shape = self.count, self._plan.ensembles, self._plan.walkers, *each[0].shape[1:]
        return np.stack(each).reshape(shape).swapaxes(0, 1)
