r"""Hamiltonian Monte Carlo with many chains side by side: for more numbers than ensembles sample.

A chain at u draws a momentum p ~ N(0, 1) and follows Hamilton's equations of

    H(u, p) = -log density(u) + p'p / 2

by leapfrog steps; its end is accepted with a chance of min(1, exp(-change of H)) (Duane et al.
1987, Hybrid Monte Carlo; Neal 2011, MCMC using Hamiltonian dynamics). Gradients carry a chain far
along a bent ridge of many dimensions, where proposals of ensembles are hardly ever accepted.

Steps are taken in u, with x = centre + half u. `half` is first that of Laplace's approximation, and
after half of the warm-up a square root of the covariance of all chains, each about the mean of the
chains at the same mode. The step is adapted during
the warm-up until 95 % of the ends are accepted. A longer step would suit most places, but in a bent
ridge chains would hardly ever leave those where the density is narrow, and its tails would be
explored slowly. Each chain takes a random fraction of the step, and trajectories have random
lengths, so that none returns to where it began. Where several modes are known, each trajectory is
followed by an attempt to jump from one mode to another (Pompe, Holmes and Latuszynski 2020, A
framework for adaptive MCMC targeting multimodal distributions). An end beyond bounds or constraints
is refused, so that many active bounds make chains slow.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.interrupts import Interrupts
from workbench.sampling.chains import Chains
from workbench.sampling.descent import Mode
from workbench.sampling.ensemble_settings import Callback, Progress, without_burn_in
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import TIMES, Mixing
from workbench.threads import limited_threads

WARM = 60  # trajectories of the warm-up
SETTLING = 5  # of them with the step that stays
FIRST = 0.1  # step at the beginning, in standard deviations of Laplace's approximation
LEAST, MOST = 1e-3, 1.5  # of a step
ACCEPTED = 0.95  # of the ends: for evenly wide densities 0.65 to 0.9 (Betancourt et al. 2014)
GAIN = 0.3  # by which the log of the step follows the acceptance
LENGTH = (0.2 * np.pi, np.pi)  # of trajectories; pi / 2 makes an end of a Gaussian forget its start
CHECKED = 150  # trajectories after which draws are judged first; then after 2, 4, ... times as many
FEWEST = 20  # trajectories after the warm-up, whatever the number of steps
KEPT = 4096  # points with all numbers that are kept at least, if there are as many


@dataclass(frozen=True)
class HamiltonianSettings:
    """How many ensembles of chains there are, and how many leapfrog steps each chain takes at most.

    A run ends when its draws are usable, unless it is to take the `whole` of its steps.
    """

    ensembles: int
    walkers: int
    steps: int
    whole: bool = False


@dataclass(frozen=True, eq=False)
class HamiltonianRun:
    """What a run has drawn.

    Attributes:
        mixing: the draws (E, S, W, k) of what is judged, and what is known of them.
        log_prob: (E, S, W) their log densities.
        points: (R, n) some of the points, with all free numbers.
        seconds: how long the run took.
        interrupted: whether it was stopped early.
    """

    mixing: Mixing
    log_prob: Array
    points: Array
    seconds: float
    interrupted: bool


def adapted(step: float, chance: float, wanted: float) -> float:
    """The next step, after one with which this share of the ends was accepted."""
    return float(np.clip(step * np.exp(GAIN * (chance - wanted)), LEAST, MOST))


def run_hamiltonian(
    target: LogDensity,
    starts: Array,
    found: Sequence[Mode],
    judged: Callable[[Array], Array],
    labels: tuple[str, ...],
    plan: HamiltonianSettings,
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
                    kept.points.add(target.subspace.points(chains.z))
                if callback is not None:
                    told = Progress(steps, plan.steps, chance, time.perf_counter() - began, True)
                    with interrupts.raised_at_once():
                        stopped = callback(told) is True
                    if stopped:
                        break
        except KeyboardInterrupt:
            stopped = True
    if not kept.count:
        raise KeyboardInterrupt  # before there was anything to keep
    mixing = kept.mixing
    log_prob = kept.log_prob[:, -mixing.draws.shape[1] :]
    seconds = time.perf_counter() - began
    return HamiltonianRun(mixing, log_prob, kept.points.all, seconds, stopped)


class _Kept:
    """What is kept of a run after its warm-up of `warm` leapfrog steps."""

    def __init__(self, plan: HamiltonianSettings, labels: tuple[str, ...]) -> None:
        self._plan, self._labels, self._goal = plan, labels, CHECKED
        self._z: list[Array] = []
        self._log_p: list[Array] = []
        self._chances, self._steps = 0.0, 0
        self.warm, self.points = 0, _Some()

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


class _Some:
    """Points of a run of unknown length, evenly spread over it."""

    def __init__(self) -> None:
        self._kept: list[Array] = []
        self._every, self._count = 1, 0

    def add(self, points: Array) -> None:
        if self._count % self._every == 0:
            self._kept.append(points)
            if len(points) * len(self._kept) >= 2 * max(KEPT, len(points)):
                self._kept = self._kept[::2]
                self._every *= 2
        self._count += 1

    @property
    def all(self) -> Array:
        return np.concatenate(self._kept)
