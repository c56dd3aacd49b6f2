"""`sample`: a posterior from a problem, a point and the names of what is to be sampled."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.problem.costs import compiled, interpreted
from workbench.sampling.conditioning import conditioning
from workbench.sampling.ensemble_settings import (
    Callback,
    EnsembleSettings,
    thinning,
    without_burn_in,
)
from workbench.sampling.ensembles import EnsembleRun, run
from workbench.sampling.feasible import refuse_flat, violation_in_words
from workbench.sampling.hamiltonian import HamiltonianSettings
from workbench.sampling.importance import of_the_rest
from workbench.sampling.joint import jointly, named
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import improper_in_words
from workbench.sampling.moves import Moves, differential_evolution
from workbench.sampling.posterior import Posterior
from workbench.sampling.subspace import Names, Rest, fixed, integrated, subspace_of
from workbench.sampling.with_the_rest import drawn_with_the_rest
from workbench.threads import limited_threads

WORTH_COMPILING = 300_000  # evaluations: compiling takes seconds, once
LEAPFROG = 2  # leapfrog steps that are allowed for each step of an ensemble
WARM_UP = 1000  # leapfrog steps: with fewer, draws of all free numbers do not begin


def sample(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    names: Names = None,
    *,
    rest: Rest = integrated,
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
    """Draw samples of the named entries (or of all that are free) from exp(-cost), around `at`.

    `names` are blocks and entries (`betas[0:3]`, `pose[left_elbow]`, `pose[left_elbow, x]`), or a
    choice such as `directions(20, priors)`. Intervals are marginal: all other numbers are
    integrated out. If there are up to 21 free numbers, all are sampled. If there are more,
    Laplace's approximation stands for those that are not named (`rest=integrated`). Unless
    importance weights say that it surely holds, all free numbers are then drawn by Hamiltonian
    Monte Carlo, and the verdict judges the draws of those that are named. Numbers can also be held
    fixed (`rest=fixed`), or follow the named entries by the linear equations among the constraints
    (`rest=determined`). Holding numbers fixed makes intervals narrower, or conditional;
    `Posterior.conditioning` says by how much, and if the factor is above 1.2, the draws are not
    called usable. Up to about 20 entries can be sampled well; more are allowed, and the verdict
    says whether their draws are usable.

    The posterior density is zero beyond bounds and inequality constraints, and outside of the
    domains of residuals, such as where a keypoint is behind its camera (`Residual.domain`).

    There are `ensembles` independent ensembles of `walkers` walkers (64, or more than twice the
    number of entries). Each takes at most `steps` steps, or fewer if a check finds the draws
    usable; Hamiltonian Monte Carlo takes at most twice as many leapfrog steps. One of every `thin`
    steps of the ensembles is kept. The same seed gives the same draws. With a `checkpoint`,
    which is a file in emcee's HDF5 format that is replaced every few seconds, a run that was
    stopped or killed continues where it was, and its result is the same; draws of Hamiltonian Monte
    Carlo are not in that file and are made again. If the checkpoint cannot be written, for example
    on a full disk, the log says so once, `Posterior.unsaved` says why, and the run continues. An
    interrupt from the keyboard, or a callback that returns True, ends a run; the draws up to then
    are kept.

    Raises UnknownName, BadArgument, Improper for a direction that neither data nor priors restrict,
    NotSupported for an equation among the constraints that draws would not satisfy or for an entry
    with equal bounds, BiasedMove, or BadFile for the checkpoint of another run.
    """
    x, given = problem.split(at)
    wanted = None if callable(names) or rest is not integrated else named(problem, names)
    shown = None
    if wanted is not None and (all_of := jointly(problem, at, wanted)):
        shown, wanted, names, rest = wanted, None, all_of, fixed
    with limited_threads():
        subspace = subspace_of(problem, x, given, wanted or names, rest)
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
        along = _along_the_ridge(target, problem.read(at), drawn, plan)
        if shown is not None:
            return along.marginal(shown)
        told = along.importance
        if told is None or told.surely or drawn.interrupted or along.improper:
            return along
        if steps < WARM_UP:
            remedy = f"take {WARM_UP:,} steps or more, so that all free numbers are sampled"
            return replace(along, importance=replace(told, remedy=remedy))
        return _with_the_rest(target, along, plan, callback)


def _along_the_ridge(
    target: LogDensity, given: Values, drawn: EnsembleRun, plan: EnsembleSettings
) -> Posterior:
    """The draws of the ensembles, and what is known of them."""
    space, thin, k = target.subspace, plan.thin, target.subspace.size
    mixing = without_burn_in(drawn.chain, thin, drawn.acceptance, space.labels)
    kept, first = mixing.draws, drawn.mode_search.modes[0]
    return Posterior(
        target.problem,
        given,
        space,
        kept,
        drawn.log_prob[:, -kept.shape[1] :],
        mixing,
        "emcee",
        drawn.mode_search,
        conditioning(target.problem, target.fixed, space, first.z),
        of_the_rest(target, kept.reshape(-1, k), plan.generator(1)),
        improper_in_words(target, first, drawn.chain[:, -1]),
        drawn.seconds,
        drawn.interrupted,
        drawn.unsaved,
    )


def _with_the_rest(
    target: LogDensity, along: Posterior, plan: EnsembleSettings, callback: Callback
) -> Posterior:
    """Draws of all free numbers in place of those along the ridge, unless only these are usable."""
    assert along.importance is not None
    most = LEAPFROG * plan.steps
    settings = HamiltonianSettings(plan.ensembles, plan.walkers, most, plan.whole)
    try:
        whole = drawn_with_the_rest(target, settings, plan.generator(2), callback)
    except KeyboardInterrupt:
        return replace(along, interrupted=True)
    if whole is None:
        return along
    run = whole.run
    if not run.mixing.usable and along.usable:
        return replace(along, interrupted=run.interrupted)
    return replace(
        along,
        draws=run.mixing.draws,
        log_prob=run.log_prob,
        mixing=run.mixing,
        method="hamiltonian",
        mode_search=whole.mode_search,
        importance=None,
        seconds=along.seconds + run.seconds,
        interrupted=run.interrupted,
        all_free=run.points,
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
