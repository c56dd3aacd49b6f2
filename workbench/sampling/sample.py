"""`sample`: a posterior from a problem, a point and the names of what is to be sampled."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.problem.batch import compiled, interpreted
from workbench.sampling.conditioning import conditioning
from workbench.sampling.ensemble_settings import (
    Callback,
    EnsembleSettings,
    thinning,
    without_burn_in,
)
from workbench.sampling.ensembles import run
from workbench.sampling.feasible import refuse_flat, violation_in_words
from workbench.sampling.importance import of_the_rest
from workbench.sampling.log_density import LogDensity
from workbench.sampling.moves import Moves, differential_evolution
from workbench.sampling.posterior import Posterior
from workbench.sampling.subspace import Names, Rest, fixed, subspace_of
from workbench.threads import limited_threads

WORTH_COMPILING = 300_000  # evaluations: compiling takes seconds, once


def sample(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    names: Names = None,
    *,
    rest: Rest = fixed,
    walkers: int | None = None,
    steps: int = 20_000,
    ensembles: int = 4,
    seed: int = 0,
    moves: Moves | None = None,
    stop_when_usable: bool = True,
    thin: int | None = None,
    checkpoint: str | Path | None = None,
    every: float = 30.0,
    callback: Callback = None,
) -> Posterior:
    """Draw from exp(-cost) in what is named (all that is free), from around `at`.

    `names` are blocks and entries (`betas[0:3]`, `pose[left_elbow]`, `pose[left_elbow, x]`), or a
    choice such as `directions(20, priors)`. All else stays where it is (`rest=fixed`), or is
    integrated out by its Gaussian conditional (`rest=conditional`), or moves with what is named as
    linear equations among the constraints tell (`rest=determined`). Holding it fixed makes
    intervals narrower; `Posterior.conditioning` says by how much, and above a factor of 1.2
    they are not called usable. Up to about 20 entries can be sampled; more are allowed, and the
    verdict will say whether their draws are usable.

    Bounds and inequality constraints end the posterior: beyond them it is zero.

    `ensembles` independent ones of `walkers` (64, or twice the entries and more) take at most
    `steps` steps each, fewer if a check finds them usable. Of every `thin` steps one is kept.
    The same seed gives the same draws. With a `checkpoint`, a file in emcee's HDF5 format that is
    replaced every so many seconds, a run goes on where it was stopped or killed, and ends as if
    nothing had been. One that cannot be written, on a full disk say, is told in the log once and
    in `Posterior.unsaved`, and the run goes on. An interrupt from the keyboard, or a callback that
    returns True, ends a run; what was drawn is kept.

    Raises UnknownName, BadArgument, Improper for a direction that nothing holds, NotSupported for
    an equation among the constraints that draws would not meet or for an entry with equal
    bounds, BiasedMove, or BadFile for the checkpoint of another run.
    """
    x, given = problem.split(at)
    with limited_threads():
        subspace = subspace_of(problem, x, given, names, rest)
        refuse_flat(problem, given, subspace)
        k = subspace.size
        walkers = max(64, 2 * (k + 11)) if walkers is None else walkers
        moves = differential_evolution() if moves is None else moves
        _check(walkers, steps, ensembles, k)
        thin = thinning(walkers, ensembles, steps, k) if thin is None else thin
        if not 1 <= thin <= steps:
            raise BadArgument(f"every {thin}th of {steps} steps cannot be kept; give 1 to {steps}")
        plan = EnsembleSettings(
            walkers, ensembles, steps, thin, seed, moves, whole=not stop_when_usable
        )
        worth = walkers * ensembles * steps >= WORTH_COMPILING
        target = LogDensity(problem, given, subspace, compiled if worth else interpreted)
        if not np.isfinite(target(subspace.centre[None])).all():
            missed = violation_in_words(problem, given, subspace.points(subspace.centre[None])[0])
            raise BadArgument(
                "the posterior has no density where it is to begin: "
                f"{missed or 'the residual is not finite there'}; solve the problem first, and "
                "begin at its answer"
            )
        path = None if checkpoint is None else Path(checkpoint)
        drawn = run(target, plan, checkpoint=path, every=every, callback=callback)
        if not drawn.chain.shape[1]:
            raise KeyboardInterrupt  # before there was anything to keep
        mixing = without_burn_in(drawn.chain, thin, drawn.acceptance, subspace.labels)
        kept = mixing.draws
        log_prob = drawn.log_prob[:, -kept.shape[1] :]
        search = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(ensembles + 1,)))
        return Posterior(
            problem,
            problem.read(at),
            subspace,
            kept,
            log_prob,
            mixing,
            "emcee",
            drawn.mode_search,
            conditioning(problem, given, subspace, drawn.mode_search.modes[0].z),
            of_the_rest(target, kept.reshape(-1, k), search),
            drawn.seconds,
            drawn.interrupted,
            drawn.unsaved,
        )


def _check(walkers: int, steps: int, ensembles: int, k: int) -> None:
    if walkers < 2 * k or walkers < 4 or walkers % 2:
        raise BadArgument(
            f"{walkers} walkers cannot move in {k} dimensions; give an even number, "
            f"{max(4, 2 * k)} or more"
        )
    for name, value in (("steps", steps), ("ensembles", ensembles)):
        if value < 1:
            raise BadArgument(f"{name} must be 1 or more, not {value}")
