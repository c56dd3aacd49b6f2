"""Several independent ensembles of emcee's, side by side, that can be stopped and taken up."""

import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import BadFile
from workbench.interrupts import Interrupts
from workbench.sampling.checkpoint import (
    Checkpoint,
    SavedEnsemble,
    load,
    memory,
    refuse_other,
    refuse_unlike,
    save,
)
from workbench.sampling.descent import Mode, mode_from
from workbench.sampling.emcee_interface import emcee
from workbench.sampling.ensemble_settings import (
    Callback,
    EnsembleSettings,
    Progress,
    without_burn_in,
)
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import TIMES
from workbench.sampling.modes import ModeSearch, improper_in_words, modes, walkers_at
from workbench.sampling.moves import refuse_biased
from workbench.threads import limited_threads

ASKED = 20  # kept steps between two questions whether draws run away


@dataclass(frozen=True, eq=False)
class EnsembleRun:
    """What a run has drawn.

    Attributes:
        chain: (E, S, W, k) the draws: ensembles, steps, walkers, entries.
        log_prob: (E, S, W) their log densities.
        acceptance: the share of the proposals that were accepted.
        mode_search: the modes that were found before sampling.
        seconds: how long the run took.
        interrupted: whether it was stopped early.
        unsaved: why the last checkpoint could not be written; empty if it was.
    """

    chain: Array
    log_prob: Array
    acceptance: float
    mode_search: ModeSearch
    seconds: float
    interrupted: bool
    unsaved: str


def run(
    target: LogDensity,
    plan: EnsembleSettings,
    *,
    checkpoint: Path | None = None,
    every: float = 30.0,
    callback: Callback = None,
) -> EnsembleRun:
    """Sample, or go on with what the checkpoint holds; every so many seconds it is replaced.

    A run that was killed and is taken up ends bit for bit as one that was not. An interrupt from
    the keyboard ends the run; what was drawn is kept. A checkpoint that cannot be written is said
    in the log, and the run goes on. Raises BiasedMove, Improper, or BadFile for a checkpoint of
    another run or in a folder that does not exist.
    """
    refuse_biased(plan.moves)
    if checkpoint is not None and not checkpoint.parent.is_dir():
        raise BadFile(f"cannot write {checkpoint}: there is no such folder; choose another")
    began = time.perf_counter()
    *seeds, search = np.random.SeedSequence(plan.seed).spawn(plan.ensembles + 1)
    with limited_threads():
        first = mode_from(target, target.subspace.centre)
        found = modes(target, first, np.random.default_rng(search))
        settings = _settings(target, plan)
        if checkpoint is not None and checkpoint.exists():
            before, saved_settings = load(checkpoint)
            refuse_other(checkpoint, saved_settings, settings)
            shape = plan.kept, plan.walkers, target.subspace.size
            refuse_unlike(checkpoint, before, plan.ensembles, shape)
            samplers = [_taken_up(target, plan, saved) for saved in before]
        else:
            samplers = [_fresh(target, plan, found.modes, seed) for seed in seeds]
        team = _Team(samplers, plan, partial(improper_in_words, target, first))
        kept = Checkpoint(checkpoint, every, lambda path: team.save(path, settings))
        with Interrupts() as interrupts:
            stopped = _drawn(team, plan, kept, interrupts, callback)
            kept.save()
    seconds, interrupted = time.perf_counter() - began, stopped or interrupts.pressed
    return team.drawn(found, seconds, interrupted, kept.failure)


def _drawn(
    team: "_Team",
    plan: EnsembleSettings,
    kept: Checkpoint,
    interrupts: Interrupts,
    callback: Callback,
) -> bool:
    """Draw until there is enough; whether it ended before that, by the callback or by Ctrl-C."""
    began = time.perf_counter()
    try:
        for progress in team.advance(began, interrupts.check):
            kept.save_now_and_then()
            if callback is not None:
                with interrupts.raised_at_once():
                    stop = _true(callback(progress))
                if stop:
                    return progress.step < plan.steps
    except KeyboardInterrupt:
        return True
    return False


class _Team:
    """The samplers, and the last complete step of each."""

    def __init__(
        self,
        samplers: list[tuple[Any, Any]],
        plan: EnsembleSettings,
        improper: Callable[[Array], str],
    ) -> None:
        self._plan, self._improper = plan, improper
        self._backends = [sampler.backend for sampler, _ in samplers]
        self._done = [self._mark(backend) for backend in self._backends]
        self._ahead: list[Iterator[Any]] = [
            sampler.sample(
                state,
                iterations=plan.kept - sampler.backend.iteration,
                thin_by=plan.thin,
                skip_initial_state_check=True,
            )
            if sampler.backend.iteration < plan.kept
            else iter(())
            for sampler, state in samplers
        ]

    @staticmethod
    def _mark(backend: Any) -> tuple[int, Array, Any]:
        return backend.iteration, backend.accepted.copy(), backend.random_state

    def advance(self, began: float, check: Callable[[], None]) -> Iterator[Progress]:
        """Step by step, the ensembles in turn, until there are enough, or until they have run away.

        `check` is called before each of them, and may raise.
        """
        for goal in self._plan.checks:
            while min(done[0] for done in self._done) < goal:
                for e, backend in enumerate(self._backends):
                    if self._done[e][0] < goal:
                        check()
                        next(self._ahead[e])
                        self._done[e] = self._mark(backend)
                yield self._progress(began)
                if self._run_away():
                    return
            if goal < self._plan.kept and self._enough(goal):
                return

    def _progress(self, began: float) -> Progress:
        step = min(done[0] for done in self._done) * self._plan.thin
        return Progress(step, self._plan.steps, self.acceptance, time.perf_counter() - began)

    @property
    def acceptance(self) -> float:
        """The share of all proposals that were accepted; emcee counts in kept steps."""
        steps = sum(done[0] for done in self._done)
        taken = sum(float(done[1].mean()) for done in self._done)
        return taken / steps if steps else 0.0

    def _run_away(self) -> bool:
        """Whether walkers are where there is no posterior; asked now and then."""
        count = min(done[0] for done in self._done)
        if count % ASKED:
            return False
        return bool(self._improper(np.stack([b.chain[count - 1] for b in self._backends])))

    def _enough(self, goal: int) -> bool:
        draws = np.stack([backend.chain[:goal] for backend in self._backends])
        mixing = without_burn_in(draws, self._plan.thin, self.acceptance, ())
        return mixing.usable and mixing.length >= TIMES  # an early end leaves nothing in doubt

    def save(self, path: Path, settings: dict[str, Any]) -> None:
        """Each ensemble after its last complete step, once each has one."""
        if min(done[0] for done in self._done):
            pairs = zip(self._backends, self._done, strict=True)
            each = [SavedEnsemble(b.chain[:n], b.log_prob[:n], *rest) for b, (n, *rest) in pairs]
            save(path, each, settings)

    def drawn(
        self, found: ModeSearch, seconds: float, interrupted: bool, unsaved: str
    ) -> EnsembleRun:
        """All that all ensembles have."""
        n = min(done[0] for done in self._done)
        chain, log_prob = (
            np.stack([getattr(backend, name)[:n] for backend in self._backends])
            for name in ("chain", "log_prob")
        )
        return EnsembleRun(chain, log_prob, self.acceptance, found, seconds, interrupted, unsaved)


def _fresh(
    target: LogDensity, plan: EnsembleSettings, found: tuple[Mode, ...], seed: Any
) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    start = walkers_at(target, found, plan.walkers, rng)
    random = np.random.RandomState(rng.integers(2**32, size=8, dtype=np.uint32))
    sampler = _sampler(target, plan, emcee().backends.Backend())
    return sampler, emcee().State(start, log_prob=target(start), random_state=random.get_state())


def _taken_up(target: LogDensity, plan: EnsembleSettings, saved: SavedEnsemble) -> tuple[Any, Any]:
    sampler = _sampler(target, plan, memory(saved))
    return sampler, sampler.get_last_sample()


def _sampler(target: LogDensity, plan: EnsembleSettings, backend: Any) -> Any:
    k = target.subspace.size
    sampler = emcee().EnsembleSampler(
        plan.walkers, k, target, moves=list(plan.moves), backend=backend, vectorize=True
    )
    # emcee's own way takes each number apart, and prints a traceback of every interrupt
    sampler.compute_log_prob = lambda z: (target(z), None)
    return sampler


def _settings(target: LogDensity, plan: EnsembleSettings) -> dict[str, Any]:
    """The settings by which a checkpoint is known to belong to the same run."""
    space = target.subspace
    digest = hashlib.sha256()
    for part in (space.origin, space.along, space.centre, target.fixed):
        digest.update(np.ascontiguousarray(part).tobytes())
    problem, there = target.problem, target.problem.stacked_constraints
    if problem.bounded:
        digest.update(problem.lower.tobytes() + problem.upper.tobytes())
    if there is not None:
        digest.update("\n".join(there.label(row) for row in range(there.size)).encode())
        digest.update(there.lower.tobytes() + there.upper.tobytes() + there.tolerance.tobytes())
    limited: dict[str, Any] = {}
    if problem.domain is not None:  # draws that were made without it may be outside
        limited["domain"] = "minded"
        digest.update(b"domain")
    return limited | {
        "walkers": plan.walkers,
        "ensembles": plan.ensembles,
        "steps": plan.steps,
        "thin": plan.thin,
        "seed": plan.seed,
        "entries": list(space.labels),
        "moves": [f"{type(m).__name__} {weight:.4g}" for m, weight in plan.moves],
        "log density at the start": float(target(space.centre[None])[0]).hex(),
        "numbers": digest.hexdigest()[:24],
    }


def _true(said: object) -> bool:
    return isinstance(said, bool | np.bool_) and bool(said)
