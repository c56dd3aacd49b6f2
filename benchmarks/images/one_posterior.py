"""Draws of all unknowns of one image, by Hamiltonian Monte Carlo or by emcee, and what is kept."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
from scipy.stats import skew

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.simd import simd_function
from workbench.bodies import SkinnedBody
from workbench.fitting.setup import Setup
from workbench.problem.costs import compiled
from workbench.sampling import Mixing, sample
from workbench.sampling.ensembles import SamplerSettings
from workbench.sampling.hamiltonian import run_hamiltonian
from workbench.sampling.log_density import LogDensity
from workbench.sampling.mixing import integrated_time
from workbench.sampling.modes import mode_from, modes, walkers_at
from workbench.sampling.subspace import fixed, movable

LEAPFROGS = SamplerSettings(ensembles=4, walkers=8, steps=30_000)  # at most, of each chain
STEPS = 80_000  # of each walker of emcee's at most
DRAWN = 30_000  # draws of emcee's of which the numbers are computed, about
NUMBERS = 38  # depth, stature, 24 across and 12 along; see `seen_from`


def compiled_places(body: SkinnedBody) -> Callable[..., Array]:
    """What `places_of` computes, by compiled code that takes several poses at once: 75 times as
    fast, so that the numbers of every draw can be looked at. Raises NoLibrary without a compiler.
    """
    symbols = [block.symbol for block in body.blocks()]
    root = body.joint_points(*symbols).source.expression
    there = body.landmark_points("coco", *symbols).source.expression
    assert root is not None
    assert there is not None
    both = cs.Function("places", symbols, [cs.horzcat(root[:, 0], there)]).expand()
    run = simd_function(both, (False, False, False))

    def places(*given: Array) -> Array:
        flat = (np.reshape(one, (len(one), -1)) for one in given)
        return run(*flat)[0].reshape(len(given[0]), -1, 3)

    return places


@dataclass(frozen=True, eq=False)
class Drawn:
    """Draws of the numbers (E, S, W, 38) of one posterior, and what is known of them."""

    mixing: Mixing
    seconds: float
    evaluations: int
    said: dict[str, Any]


def by_hamiltonian(setup: Setup, values: Values, numbers: Any, seed: int) -> Drawn:
    """All free numbers by Hamiltonian Monte Carlo, until those that are reported have mixed.

    A pinhole camera also projects what is behind it, upside down, and bodies there can fit as well
    as those in front. The posterior has no density there (`Residual.domain`). How much mass would
    be there is told by a search for modes of the same residuals without their domains, and chains
    begin at those modes of this search that are in front.
    """
    began, problem = time.process_time(), setup.problem
    x, given = problem.split(values)
    free = np.flatnonzero(movable(problem))
    space = fixed(problem, problem.linearize_at(x, given), x, free)
    target, rng = LogDensity(problem, given, space, compiled), np.random.default_rng((seed, 1))
    residuals = [replace(one, domain=None) for one in problem.residuals]
    pinhole = replace(target, problem=problem.variant(residuals, problem.free.spelled()))
    every = modes(pinhole, mode_from(pinhole, space.centre), rng).modes
    found = tuple(one for one in every if target.in_domain(one.z[None])[0])
    starts = walkers_at(target, found, LEAPFROGS.ensembles * LEAPFROGS.walkers, rng)
    labels = tuple(map(str, range(NUMBERS)))
    run = run_hamiltonian(
        target, starts, found, lambda z: numbers(space.points(z)), labels, LEAPFROGS, rng
    )
    if run.interrupted:
        raise KeyboardInterrupt
    taken = run.mixing.discarded + run.mixing.steps
    return Drawn(
        run.mixing,
        time.process_time() - began,
        taken * len(starts),
        {
            "usable": run.mixing.usable,
            "verdict": str(run.mixing),
            "modes": [mode.share for mode in found],
            "behind": sum(mode.share for mode in every if mode not in found),
        },
    )


def by_emcee(setup: Setup, values: Values, numbers: Any, seed: int, checkpoint: Path) -> Drawn:
    """All free numbers by emcee, until all of them have mixed, or for `STEPS` steps."""
    began = time.process_time()
    posterior = sample(setup.problem, values, steps=STEPS, seed=seed, checkpoint=checkpoint)
    if posterior.interrupted:
        raise KeyboardInterrupt  # the checkpoint has what was drawn
    E, S, W, k = posterior.draws.shape
    every = max(1, round(E * S * W / DRAWN))
    some = posterior.draws[:, :, ::every].reshape(-1, k)
    told = numbers(posterior.subspace.points(some)).reshape(E, S, -1, NUMBERS)
    whole = posterior.mixing
    mixing = Mixing(
        tuple(map(str, range(NUMBERS))), told, whole.acceptance, whole.discarded, whole.thin
    )
    said = {
        "usable": posterior.usable,
        "verdict": posterior.verdict,
        "autocorrelation": float(whole.times.max()),
        "times": float(whole.length),
        "R-hat": float(whole.scales.max()),
        "effective": float(whole.effective.min()),
        "acceptance": float(whole.acceptance),
        "modes": [mode.share for mode in posterior.modes],
    }
    steps = whole.discarded + whole.steps
    return Drawn(
        mixing,
        time.process_time() - began,
        steps * E * W,
        {"usable": posterior.usable, "modes": said.pop("modes"), "entries": said},
    )


def summary(found: Drawn, offset: Array, rng: np.random.Generator) -> dict[str, Any]:
    """What is kept of draws: moments with their standard errors, and ends of 90 % intervals.

    `offset` are the standard deviations (38,) that a detector's landmarks add, which are drawn
    independently and added for the second pair of ends.
    """
    mixing = found.mixing
    flat = mixing.draws.reshape(-1, NUMBERS)
    mean, sd = flat.mean(axis=0), flat.std(axis=0)
    squares = (mixing.draws - mean) ** 2
    times = mixing.thin * np.array([integrated_time(squares[..., i]) for i in range(NUMBERS)])
    of_squares = flat.shape[0] * mixing.thin / times
    low, middle, high = np.quantile(flat, [0.05, 0.5, 0.95], axis=0)
    wide = flat + offset * rng.standard_normal(flat.shape)
    of_wide = np.quantile(wide, [0.05, 0.5, 0.95], axis=0)
    columns = {
        "mean": mean,
        "sd": sd,
        "error of mean": sd / np.sqrt(mixing.effective),
        "error of sd": squares.reshape(-1, NUMBERS).std(axis=0) / np.sqrt(of_squares) / (2 * sd),
        "skewness": skew(flat, axis=0),
        "ends": np.stack([low, middle, high]),
        "ends with offsets": of_wide,
    }
    return found.said | {
        "draws": {name: one.tolist() for name, one in columns.items()},
        "R-hat": float(mixing.scales.max()),
        "times": float(mixing.length),
        "autocorrelation": float(mixing.times.max()),
        "effective": float(mixing.effective.min()),
        "acceptance": float(mixing.acceptance),
        "seconds": found.seconds,
        "evaluations": found.evaluations,
    }
