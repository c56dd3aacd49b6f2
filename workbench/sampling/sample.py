"""`sample`: a posterior from a problem, a point and the names of what is to be sampled."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.layout import entries
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.problem.costs import compiled, interpreted
from workbench.sampling.conditioning import conditioning
from workbench.sampling.ensembles import (
    Callback,
    EnsembleRun,
    SamplerSettings,
    run,
    thinning,
    without_burn_in,
)
from workbench.sampling.hamiltonian import HamiltonianRun, run_hamiltonian
from workbench.sampling.importance import of_the_rest
from workbench.sampling.log_density import LogDensity, refuse_flat, violation_in_words
from workbench.sampling.modes import (
    Mode,
    ModeSearch,
    NoMinimum,
    improper_in_words,
    mode_from,
    modes,
    rows_between,
    walkers_at,
)
from workbench.sampling.posterior import Posterior
from workbench.sampling.subspace import (
    MOST,
    Improper,
    Names,
    Rest,
    Subspace,
    fixed,
    integrated,
    movable,
    subspace_of,
)
from workbench.threads import limited_threads

SAME_MODE = 1.0  # standard deviations between two modes that are one in what is named
WORTH_COMPILING = 300_000  # evaluations: compiling takes seconds, once
LEAPFROG_STEPS = 2  # that are allowed for each step of an ensemble
LEAST_STEPS = 1000  # leapfrog steps: with fewer, draws of all free numbers do not begin


def named(problem: Problem, names: str | Iterable[str] | None) -> tuple[str, ...]:
    """The names as a tuple; None means all free blocks."""
    if names is None:
        return problem.free.names
    return (names,) if isinstance(names, str) else tuple(names)


def jointly(
    problem: Problem, at: Mapping[str, ArrayLike], names: tuple[str, ...], most: int = MOST
) -> tuple[str, ...]:
    """The labels of all numbers to be drawn with the named ones, if there are at most so many.

    Empty if there are more, if nothing but the named ones can be drawn, or if the others have no
    width. Numbers with equal bounds, and those that equations read, are not drawn.
    """
    chosen = entries(problem.free, names)
    if problem.free.size > most or len(chosen) == problem.free.size:
        return ()
    here = problem.linearize_at(*problem.split(at))
    free = movable(problem)
    others = np.setdiff1d(np.flatnonzero(free), chosen)
    # named ones that cannot be drawn are refused where they are read
    if here.by_frames or not free[chosen].all() or not others.size:
        return ()
    between = rows_between(problem.lower, problem.upper, 1.0)
    J = np.vstack([here.dense, between])[:, others]
    lengths = np.linalg.norm(J, axis=0)
    if np.linalg.matrix_rank(J / np.where(lengths > 0, lengths, 1.0)) < len(others):
        return ()
    return tuple(problem.free.labels_of(np.sort(np.concatenate([chosen, others]))))


def drawn_with_the_rest(
    target: LogDensity,
    plan: SamplerSettings,
    rng: np.random.Generator,
    callback: Callback = None,
) -> tuple[HamiltonianRun, ModeSearch] | None:
    """Draws of all free numbers, judged in what the target samples, and the modes in these.

    None where a direction of the rest has no width or leads to no minimum. Chains begin at draws
    of Laplace's approximation at the modes of everything, each mode by its share of the mass.
    """
    problem, space = target.problem, target.subspace
    x, fixed_values = space.origin, target.fixed
    free = np.flatnonzero(movable(problem))
    all_free = fixed(problem, problem.linearize_at(x, fixed_values), x, free)
    whole = LogDensity(problem, fixed_values, all_free, target.way)
    try:
        first = mode_from(whole, all_free.centre)
        mode_search = modes(whole, first, rng)
    except (Improper, NoMinimum, np.linalg.LinAlgError):
        return None
    minima = mode_search.modes
    starts = walkers_at(whole, minima, plan.ensembles * plan.walkers, rng)
    into = (space.entries[:, None] == free).astype(float)  # (k, c): from all that is free to z
    drawn = run_hamiltonian(
        whole,
        starts,
        minima,
        lambda z: space.centre + (z - x[free]) @ into.T,
        space.labels,
        plan,
        rng,
        callback,
    )
    return drawn, replace(mode_search, modes=_in_z(minima, space, x[free], into))


def _in_z(
    minima: tuple[Mode, ...], space: Subspace, centre: Array, into: Array
) -> tuple[Mode, ...]:
    """The modes in z; those that are the same there are one."""
    kept: list[Mode] = []
    for minimum in minima:
        mode = minimum.mapped(into, space.centre + into @ (minimum.z - centre))
        for i, known in enumerate(kept):
            if max(known.distance(mode.z), mode.distance(known.z)) < SAME_MODE:
                kept[i] = replace(known, share=known.share + mode.share)
                break
        else:
            kept.append(mode)
    return tuple(kept)


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
    stop_when_usable: bool = True,
    thin: int | None = None,
    checkpoint: str | Path | None = None,
    every: float = 30.0,
    callback: Callback = None,
) -> Posterior:
    """Draw samples of the named entries (or of all that are free) from exp(-cost), around `at`.

    `names` are blocks and entries (`betas[0:3]`, `pose[left_elbow]`, `pose[left_elbow, x]`).
    Intervals are marginal: all other numbers are integrated out. If there are up to 21 free
    numbers, all are sampled. If there are more, Laplace's approximation stands for those that are
    not named (`rest=integrated`). Unless importance weights say that it surely holds, all free
    numbers are then drawn by Hamiltonian Monte Carlo, and the verdict judges the draws of those
    that are named. Numbers can also be held fixed (`rest=fixed`), which makes intervals narrower,
    or conditional: `Posterior.conditioning` says by how much, and if the factor is above 1.2, the
    draws are not called usable.

    The posterior density is zero beyond bounds and inequality constraints, and outside of the
    domains of residuals, such as where a keypoint is behind its camera (`Residual.domain`).

    There are `ensembles` independent ensembles of `walkers` walkers (64, or more than twice the
    number of entries). Each takes at most `steps` steps, or fewer if a check finds the draws
    usable; Hamiltonian Monte Carlo takes at most twice as many leapfrog steps. One of every `thin`
    steps of the ensembles is kept. The same seed gives the same draws. With a `checkpoint`, which
    is an .npz file that is replaced every so many seconds, a run that was stopped or killed
    continues where it was, and its result is the same; draws of Hamiltonian Monte Carlo are not in
    that file and are made again. If the checkpoint cannot be written, for example
    on a full disk, the log says so once, `Posterior.unsaved` says why, and the run continues. An
    interrupt from the keyboard, or a callback that returns True, ends a run; the draws up to then
    are kept.

    Raises UnknownName, BadArgument, Improper for a direction that neither data nor priors restrict,
    NotSupported for an equation among the constraints that draws would not satisfy or for an entry
    with equal bounds, or BadFile for the checkpoint of another run.
    """
    x, fixed_values = problem.split(at)
    names, shown = named(problem, names), None
    if rest is integrated and (all_names := jointly(problem, at, names)):
        shown, names, rest = names, all_names, fixed
    with limited_threads():
        subspace = subspace_of(problem, x, fixed_values, names, rest)
        refuse_flat(problem, fixed_values, subspace)
        k = subspace.size
        walkers = max(64, 2 * (k + 11)) if walkers is None else walkers
        if walkers < 2 * k or walkers < 4 or walkers % 2:
            raise BadArgument(
                f"{walkers} walkers cannot move in {k} dimensions; give an even number, "
                f"{max(4, 2 * k)} or more"
            )
        for name, value in (("steps", steps), ("ensembles", ensembles)):
            if value < 1:
                raise BadArgument(f"{name} must be 1 or more, not {value}")
        thin = thinning(walkers, ensembles, steps, k) if thin is None else thin
        if not 1 <= thin <= steps:
            raise BadArgument(f"every {thin}th of {steps} steps cannot be kept; give 1 to {steps}")
        plan = SamplerSettings(walkers, ensembles, steps, thin, seed, whole=not stop_when_usable)
        worth_compiling = walkers * ensembles * steps >= WORTH_COMPILING
        way = compiled if worth_compiling else interpreted
        target = LogDensity(problem, fixed_values, subspace, way)
        _refuse_no_density(target)
        path = None if checkpoint is None else Path(checkpoint)
        drawn = run(target, plan, checkpoint=path, every=every, callback=callback)
        if not drawn.chain.shape[1]:
            raise KeyboardInterrupt  # before there was anything to keep
        posterior = _along_the_ridge(target, problem.read(at), drawn, plan)
        if shown is not None:
            return posterior.marginal(shown)
        importance = posterior.importance
        if importance is None or importance.surely or drawn.interrupted or posterior.improper:
            return posterior
        if steps < LEAST_STEPS:
            remedy = f"take {LEAST_STEPS:,} steps or more, so that all free numbers are sampled"
            return replace(posterior, importance=replace(importance, remedy=remedy))
        return _with_the_rest(target, posterior, plan, callback)


def _refuse_no_density(target: LogDensity) -> None:
    """Raise BadArgument if the posterior has no density at the point where draws are to begin."""
    space = target.subspace
    if np.isfinite(target(space.centre[None])).all():
        return
    x = space.points(space.centre[None])[0]
    why = violation_in_words(target.problem, target.fixed, x)
    raise BadArgument(
        "the posterior has no density where it is to begin: "
        f"{why or 'the residual is not finite there'}; solve the problem first, and begin at its "
        "answer"
    )


def _along_the_ridge(
    target: LogDensity, values: Values, drawn: EnsembleRun, plan: SamplerSettings
) -> Posterior:
    """The draws of the ensembles, and what is known of them."""
    space, thin, k = target.subspace, plan.thin, target.subspace.size
    mixing = without_burn_in(drawn.chain, thin, drawn.acceptance, space.labels)
    kept, first = mixing.draws, drawn.mode_search.modes[0]
    return Posterior(
        target.problem,
        values,
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
    target: LogDensity, ridge: Posterior, plan: SamplerSettings, callback: Callback
) -> Posterior:
    """Draws of all free numbers in place of those along the ridge, unless only these are usable."""
    assert ridge.importance is not None
    settings = replace(plan, steps=LEAPFROG_STEPS * plan.steps)
    try:
        whole = drawn_with_the_rest(target, settings, plan.generator(2), callback)
    except KeyboardInterrupt:
        return replace(ridge, interrupted=True)
    if whole is None:
        return ridge
    run, mode_search = whole
    if not run.mixing.usable and ridge.usable:
        return replace(ridge, interrupted=run.interrupted)
    return replace(
        ridge,
        draws=run.mixing.draws,
        log_prob=run.log_prob,
        mixing=run.mixing,
        method="hamiltonian",
        mode_search=mode_search,
        importance=None,
        seconds=ridge.seconds + run.seconds,
        interrupted=run.interrupted,
        all_free=run.points,
    )
