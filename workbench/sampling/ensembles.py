"""Several independent ensembles of emcee's, side by side, that can be stopped and taken up.

Walkers move by differential evolution (ter Braak 2006; Nelson et al. 2014): a step is the
difference of two other walkers times 2.38 / sqrt(2 k), and every tenth time the whole difference,
which leads from mode to mode. These moves are invariant under affine maps, so there is nothing to
whiten. The proposals are emcee's, accepted for half of the ensemble at once: emcee's own loop asks
one walker after the other, which costs more than a compiled posterior does.
"""

import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array, Mask
from workbench.environment import optional_library
from workbench.errors import BadFile
from workbench.interrupts import Interrupts
from workbench.sampling.checkpoint import Checkpoint, SavedEnsemble, load, save
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import LONG_TIMES, Mixing
from workbench.sampling.modes import (
    ModeSearch,
    improper_in_words,
    mode_from,
    modes,
    walkers_at,
)
from workbench.threads import limited_threads

JUMPS = 0.1  # of the steps
MOST_NUMBERS = 2e7  # that are kept in memory: 160 MB
CHECKS = (1 / 16, 1 / 8, 1 / 4, 1 / 2)  # of the steps: when usable then, that is enough
BURN_IN = 0.1  # share of the steps that is discarded at least
BURN_IN_TIMES = 5.0  # autocorrelation times that are discarded, but no more than half of the steps
STEPS_BETWEEN = 20  # kept steps between two questions whether draws run away


def stepped(z: Array, log_p: Array, density: Callable[[Array], Array], random: Any) -> Mask:
    """Move walkers z (W, k) with log densities (W,), in place, by a step; which of them (W,) moved.

    emcee's own step by `DEMove`, with the same random numbers in the same order.
    """
    move = _moves()[int(random.choice(2, p=(1 - JUMPS, JUMPS)))]
    move.setup(z)
    moved = np.zeros(len(z), dtype=bool)
    group = np.arange(len(z)) % 2
    random.shuffle(group)
    for half in range(2):
        moving = np.flatnonzero(group == half)
        y, factors = move.get_proposal(z[moving], [z[group != half]], random)
        log_p_y = density(y)
        accepted = factors + log_p_y - log_p[moving] > np.log(random.rand(len(moving)))
        z[moving[accepted]], log_p[moving[accepted]] = y[accepted], log_p_y[accepted]
        moved[moving[accepted]] = True
    return moved


def _moves() -> tuple[Any, Any]:
    """Steps of differential evolution, and jumps. Raises MissingLibrary without emcee."""
    moves = optional_library("emcee", "drawing a posterior by ensembles of walkers").moves
    return moves.DEMove(), moves.DEMove(gamma0=1.0)


@dataclass(frozen=True)
class SamplingProgress:
    """How far a run is."""

    step: int  # how many steps each walker has taken
    steps: int  # how many it takes at most
    acceptance: float  # the share of the proposals that were accepted
    seconds: float  # the time since the run began
    all_free: bool = False  # whether all free numbers are being sampled, by Hamiltonian Monte Carlo


Callback = Callable[[SamplingProgress], object] | None  # called after each step


def asks_to_stop(answer: object) -> bool:
    """Whether what a callback returned is True, also NumPy's; any other object is no answer."""
    return isinstance(answer, bool | np.bool_) and bool(answer)


@dataclass(frozen=True)
class SamplerSettings:
    """How to sample: several independent ensembles of walkers, or of Hamiltonian chains.

    Ensembles of walkers end early, after 1/16, 1/8, 1/4 or 1/2 of the steps, if their draws are
    usable by then; chains are judged after 150, 300, 600, ... trajectories.
    """

    walkers: int  # how many walkers or chains an ensemble has
    ensembles: int  # how many independent ensembles there are
    steps: int  # how many steps, or leapfrog steps, each takes at most
    thin: int = 1  # every how many steps of a walker one is kept
    seed: int = 0  # the seed of all random numbers
    whole: bool = False  # whether to take all steps, even if the draws are usable earlier

    def generator(self, stream: int) -> np.random.Generator:
        """Random numbers of what follows the ensembles, one stream for each purpose."""
        key = (self.ensembles + stream,)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))

    @property
    def kept(self) -> int:
        """How many steps of each walker are kept."""
        return self.steps // self.thin

    @property
    def checks(self) -> list[int]:
        """After how many kept steps the draws are judged: the early checks, and the end."""
        early = [] if self.whole else [int(self.kept * share) for share in CHECKS]
        return [*(n for n in early if n >= 20), self.kept]


def thinning(walkers: int, ensembles: int, steps: int, size: int) -> int:
    """Every how many steps one is to be kept, so that all that is kept fits into memory."""
    kept = np.clip(MOST_NUMBERS / (walkers * ensembles * size), 200, 4000)
    return max(1, int(np.ceil(steps / kept)))


def without_burn_in(chain: Array, thin: int, acceptance: float, labels: tuple[str, ...]) -> Mixing:
    """The mixing of chains (E, S, W, k) without their burn-in.

    A tenth of the steps is discarded, or five autocorrelation times if that is more, but no more
    than half of the steps.
    """
    _, S, _, k = chain.shape
    labels = labels or tuple(map(str, range(k)))
    first = int(np.ceil(BURN_IN * S))
    before = Mixing(labels, chain[:, first:], acceptance, first * thin, thin)
    longest = before.times.max() / thin if S - first > 1 else 0.0
    burn_in = min(BURN_IN_TIMES * longest, S / 2)
    if burn_in <= first:
        return before
    first = int(np.ceil(burn_in))
    return Mixing(labels, chain[:, first:], acceptance, first * thin, thin)


@dataclass(frozen=True, eq=False)
class EnsembleRun:
    """What a run has drawn."""

    chain: Array  # (E, S, W, k) the draws: ensembles, steps, walkers, entries
    log_prob: Array  # (E, S, W) their log densities
    acceptance: float  # the share of the proposals that were accepted
    mode_search: ModeSearch  # the modes that were found before sampling
    seconds: float  # how long the run took
    interrupted: bool  # whether it was stopped early
    unsaved: str  # why the last checkpoint could not be written; empty if it was


def run(
    target: LogDensity,
    plan: SamplerSettings,
    *,
    checkpoint: Path | None = None,
    every: float = 30.0,
    callback: Callback = None,
) -> EnsembleRun:
    """Sample, or go on with what the checkpoint holds; every so many seconds it is replaced.

    A run that was killed and is taken up ends bit for bit as one that was not. An interrupt from
    the keyboard ends the run; what was drawn is kept. A checkpoint that cannot be written is said
    in the log, and the run goes on. Raises Improper, or BadFile for a checkpoint of another run or
    in a folder that does not exist.
    """
    if checkpoint is not None and not checkpoint.parent.is_dir():
        raise BadFile(f"cannot write {checkpoint}: there is no such folder; choose another")
    began = time.perf_counter()
    *seeds, search_seed = np.random.SeedSequence(plan.seed).spawn(plan.ensembles + 1)
    with limited_threads():
        first = mode_from(target, target.subspace.centre)
        mode_search = modes(target, first, np.random.default_rng(search_seed))
        settings = _settings(target, plan)
        if checkpoint is not None and checkpoint.exists():
            saved = load(checkpoint, settings)
            each = [Ensemble.resumed(target, plan, ensemble) for ensemble in saved]
        else:
            each = [Ensemble.begun(target, plan, mode_search, seed) for seed in seeds]
        ensembles = _Ensembles(each, plan, partial(improper_in_words, target, first))
        file = Checkpoint(checkpoint, every, lambda path: ensembles.save(path, settings))
        stopped, sampling_began = False, time.perf_counter()
        with Interrupts() as interrupts:
            try:
                for progress in ensembles.advance(sampling_began, interrupts.check):
                    file.save_now_and_then()
                    if callback is not None:
                        with interrupts.raised_at_once():
                            stop = asks_to_stop(callback(progress))
                        if stop:
                            stopped = progress.step < plan.steps
                            break
            except KeyboardInterrupt:
                stopped = True
            file.save()
    seconds, interrupted = time.perf_counter() - began, stopped or interrupts.pressed
    return EnsembleRun(
        ensembles.chain,
        ensembles.log_prob,
        ensembles.acceptance,
        mode_search,
        seconds,
        interrupted,
        file.failure,
    )


class Ensemble:
    """Walkers at z (W, k), their random numbers, and the `count` steps that are kept of them."""

    def __init__(
        self, target: LogDensity, plan: SamplerSettings, z: Array, log_p: Array, random_state: Any
    ) -> None:
        self._target, self._thin = target, plan.thin
        self._z, self._log_p = z.copy(), log_p.copy()
        self._random, self.random_state = np.random.RandomState(), random_state
        self._random.set_state(tuple(random_state))
        self.chain, self.log_prob = np.empty((plan.kept, *z.shape)), np.empty((plan.kept, len(z)))
        self.accepted, self.count = np.zeros(len(z)), 0

    @staticmethod
    def begun(
        target: LogDensity,
        plan: SamplerSettings,
        mode_search: ModeSearch,
        seed: np.random.SeedSequence,
    ) -> "Ensemble":
        """An ensemble that begins at draws of Laplace's approximations at the modes."""
        rng = np.random.default_rng(seed)
        z = walkers_at(target, mode_search.modes, plan.walkers, rng)
        random = np.random.RandomState(rng.integers(2**32, size=8, dtype=np.uint32))
        return Ensemble(target, plan, z, target(z), random.get_state())

    @staticmethod
    def resumed(target: LogDensity, plan: SamplerSettings, saved: SavedEnsemble) -> "Ensemble":
        """An ensemble that continues."""
        z, log_p = saved.chain[-1], saved.log_prob[-1]
        ensemble = Ensemble(target, plan, z, log_p, saved.random_state)
        ensemble.accepted, ensemble.count = saved.accepted, len(saved.chain)
        ensemble.chain[: ensemble.count] = saved.chain
        ensemble.log_prob[: ensemble.count] = saved.log_prob
        return ensemble

    def advance(self) -> None:
        """Take steps to the next one that is kept, and keep it."""
        for _ in range(self._thin):
            moved = stepped(self._z, self._log_p, self._target, self._random)
        self.chain[self.count], self.log_prob[self.count] = self._z, self._log_p
        self.accepted, self.random_state = self.accepted + moved, self._random.get_state()
        self.count += 1

    @property
    def saved(self) -> SavedEnsemble:
        """What continues it."""
        kept = self.chain[: self.count], self.log_prob[: self.count]
        return SavedEnsemble(*kept, self.accepted, self.random_state)


class _Ensembles:
    """All ensembles of a run."""

    def __init__(
        self, each: list[Ensemble], plan: SamplerSettings, improper: Callable[[Array], str]
    ) -> None:
        self._each, self._plan, self._improper = each, plan, improper

    def advance(self, began: float, check: Callable[[], None]) -> Iterator[SamplingProgress]:
        """Step by step, the ensembles in turn, until there are enough, or until they have run away.

        `check` is called before each of them, and may raise.
        """
        for goal in self._plan.checks:
            while self._count < goal:
                for ensemble in self._each:
                    if ensemble.count < goal:
                        check()
                        ensemble.advance()
                step, seconds = self._count * self._plan.thin, time.perf_counter() - began
                yield SamplingProgress(step, self._plan.steps, self.acceptance, seconds)
                last = [ensemble.chain[self._count - 1] for ensemble in self._each]
                if self._count % STEPS_BETWEEN == 0 and self._improper(np.stack(last)):
                    return
            if goal < self._plan.kept and self._enough:
                return

    @property
    def _count(self) -> int:
        """How many steps all ensembles have kept."""
        return min(ensemble.count for ensemble in self._each)

    @property
    def acceptance(self) -> float:
        """The share of the proposals that were accepted, in the steps that are kept."""
        steps = sum(ensemble.count for ensemble in self._each)
        accepted = sum(float(ensemble.accepted.mean()) for ensemble in self._each)
        return accepted / steps if steps else 0.0

    @property
    def _enough(self) -> bool:
        mixing = without_burn_in(self.chain, self._plan.thin, self.acceptance, ())
        return mixing.usable and mixing.length >= LONG_TIMES  # an early end leaves nothing in doubt

    def save(self, path: Path, settings: dict[str, Any]) -> None:
        """Each ensemble after its last complete step, once each has ensemble."""
        if self._count:
            save(path, [ensemble.saved for ensemble in self._each], settings)

    @property
    def chain(self) -> Array:
        """(E, S, W, k) what all ensembles have."""
        return np.stack([ensemble.chain[: self._count] for ensemble in self._each])

    @property
    def log_prob(self) -> Array:
        """(E, S, W) its log densities."""
        return np.stack([ensemble.log_prob[: self._count] for ensemble in self._each])


def _settings(target: LogDensity, plan: SamplerSettings) -> dict[str, Any]:
    """The settings by which a checkpoint is known to belong to the same run."""
    space = target.subspace
    digest = hashlib.sha256()
    for part in (space.origin, space.along, space.centre, target.fixed):
        digest.update(np.ascontiguousarray(part).tobytes())
    problem, constraints = target.problem, target.problem.stacked_constraints
    if problem.bounded:
        digest.update(problem.lower.tobytes() + problem.upper.tobytes())
    if constraints is not None:
        labels = [constraints.label(row) for row in range(constraints.size)]
        digest.update("\n".join(labels).encode())
        for limit in (constraints.lower, constraints.upper, constraints.tolerance):
            digest.update(limit.tobytes())
    return {
        "domain": problem.domain is not None,  # draws that were made without it may be outside
        "walkers": plan.walkers,
        "ensembles": plan.ensembles,
        "steps": plan.steps,
        "thin": plan.thin,
        "seed": plan.seed,
        "entries": list(space.labels),
        "moves": ["VectorizedMove 0.9", "VectorizedMove 0.1"],
        "log density at the start": float(target(space.centre[None])[0]).hex(),
        "numbers": digest.hexdigest()[:24],
    }
