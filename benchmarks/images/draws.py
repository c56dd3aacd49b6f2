"""The command `python -m benchmarks.images.draws FOLDER`: draws of posteriors of one image.

What `benchmarks.images.intervals` takes from Laplace's approximation is drawn here: by Hamiltonian
Monte Carlo, all 85 unknowns at once, and for a few of the same posteriors by emcee as well. Each
posterior is kept in FOLDER as soon as it is drawn, and an ensemble of emcee's every half a minute,
so that the command continues where it was stopped. Numbers go to `results/draws.json`, and the
tables of IMAGES.md are written from them.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
from scipy.stats import skew

from benchmarks import machine
from benchmarks.images.draws_tables import BEGIN, END, RESULTS, tables
from benchmarks.images.intervals import fitted, seen_from, view_of
from benchmarks.images.one_camera import (
    NOISE,
    PAGE,
    STATURE,
    Case,
    balance_cases,
    synthetic_cases,
)
from benchmarks.keeping import keep, write_between
from benchmarks.posterior.pieces import Pieces
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.simd import simd_function
from workbench.bodies import SkinnedBody
from workbench.fitting.depth_interval import OFFSET, spreads
from workbench.fitting.image_fit import ImageFits
from workbench.fitting.image_recipe import ByHeight, WithStature
from workbench.fitting.setup import Setup
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.problem.batch import compiled
from workbench.sampling import Mixing, sample
from workbench.sampling.autocorrelation import integrated_time
from workbench.sampling.descent import mode_from
from workbench.sampling.hamiltonian import HamiltonianSettings, run_hamiltonian
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import modes, walkers_at
from workbench.sampling.subspace import fixed, movable

LEAPFROGS = HamiltonianSettings(ensembles=4, walkers=8, steps=30_000)  # at most, of each chain
STEPS = 80_000  # of each walker of emcee's at most: some 60 autocorrelation times
DRAWN = 30_000  # draws of emcee's of which the numbers are computed, about
NUMBERS = 38  # depth, stature, 24 across and 12 along; see `seen_from`


@dataclass(frozen=True)
class Posteriors:
    """Posteriors that are drawn by one method, in the order in which that is done.

    Attributes:
        kind: `unknown` or `known` stature of the person of `balance`, or `people`.
        method: `hamiltonian` or `emcee`.
        images: frames of `balance`, or the seeds of synthetic people.
        cameras: those of `balance` that are drawn from.
    """

    kind: str
    method: str
    images: tuple[int, ...]
    cameras: tuple[str, ...] = ("cam01", "cam02", "cam03", "cam04")


def of_balance(method: str, images: tuple[int, ...], *cameras: str) -> tuple[Posteriors, ...]:
    """With unknown and with known stature."""
    some = (cameras,) if cameras else ()
    return tuple(Posteriors(kind, method, images, *some) for kind in ("unknown", "known"))


PLAN = (
    *of_balance("hamiltonian", (40,)),
    Posteriors("unknown", "emcee", (40,), ("cam03",)),
    Posteriors("people", "hamiltonian", tuple(range(6))),
    *of_balance("hamiltonian", (0,)),
    Posteriors("known", "emcee", (40,), ("cam01",)),
    Posteriors("people", "hamiltonian", tuple(range(6, 12))),
    *of_balance("hamiltonian", (80,)),
    Posteriors("unknown", "emcee", (40,), ("cam01",)),
    *of_balance("hamiltonian", (20, 60)),
    Posteriors("people", "hamiltonian", tuple(range(12, 40))),
    Posteriors("known", "emcee", (40,), ("cam03",)),
    *of_balance("hamiltonian", (12, 32, 52, 72, 92)),
)


@dataclass(frozen=True, eq=False)
class Fits:
    """Fits of all kinds of posteriors, and the cases by kind and image."""

    body: SkinnedBody
    of: dict[str, ImageFits]
    poses: Array
    places: Callable[..., Array]

    def cases(self, kind: str, image: int) -> Iterator[tuple[str, Case]]:
        """The cases of one image, with the name of each; one for each camera of `balance`."""
        if kind == "people":
            some = synthetic_cases(self.body, self.poses, range(image, image + 1), 0)
        else:
            some = balance_cases(self.body, [image])
        for case in some:
            held = case.held_out
            names = [photo.name for photo in case.observed.photographs]
            yield next(name for name in names if name not in held), case


def all_fits() -> Fits:
    """What `benchmarks.images.intervals` fits."""
    body = load_body("default")
    recipes = {
        "unknown": ByHeight(),
        "known": ByHeight(priors=WithStature(STATURE)),
        "people": ByHeight(sigma=NOISE),
    }
    poses = draw_poses(shipped_gaussian(), 2000, np.random.default_rng(5))
    fits = {kind: ImageFits(body, one) for kind, one in recipes.items()}
    return Fits(body, fits, poses, compiled_places(body))


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

    A pinhole camera also projects what is behind it, upside down. Bodies there can fit as well as
    those in front; chains begin in front alone, and none gets behind.
    """
    began, problem = time.process_time(), setup.problem
    x, given = problem.split(values)
    free = np.flatnonzero(movable(problem))
    space = fixed(problem, problem.linearize_at(x, given), x, free)
    target, rng = LogDensity(problem, given, space, compiled), np.random.default_rng((seed, 1))
    every = modes(target, mode_from(target, space.centre), rng).modes
    found = tuple(one for one in every if numbers(space.points(one.z[None]))[0, 0] > 0)
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


def drawn(fits: Fits, kind: str, method: str, case: Case, seed: int, saved: Path) -> dict[str, Any]:
    """One posterior: Laplace's approximation, draws, and the truth, of all numbers."""
    assert case.made_of is not None
    body = fits.body
    setup, values = fitted(fits.of[kind], case)
    of = seen_from(body, view_of(setup), values, fits.places)
    slices = setup.problem.free.slices

    def numbers(x: Array) -> Array:
        """(M, 38) of free numbers x (M, n)."""
        blocks = body.blocks()
        return of(*(x[:, slices[b.name]].reshape(-1, *np.shape(values[b.name])) for b in blocks))

    if method == "emcee":
        found = by_emcee(setup, values, numbers, seed, saved)
    else:
        found = by_hamiltonian(setup, values, numbers, seed)
    true = of(*(case.made_of[block.name][None] for block in body.blocks()))[0]
    fit, sd, lever = spreads(setup, view_of(setup), values, of)
    laplace = {"fit": fit, "sd": sd, "lever": lever, "true": true}
    told = {"laplace": {name: one.tolist() for name, one in laplace.items()}}
    rng = np.random.default_rng((seed, 2))
    return told | summary(found, true, OFFSET * lever, rng)


def summary(found: Drawn, true: Array, offset: Array, rng: np.random.Generator) -> dict[str, Any]:
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
        "below": np.mean(flat < true, axis=0),
        "ends": np.stack([low, middle, high]),
        "ends with offsets": of_wide,
    }
    return found.said | {
        "draws": {name: one.tolist() for name, one in columns.items()},
        "nearest": float(flat[:, 0].min()),
        "R-hat": float(mixing.scales.max()),
        "times": float(mixing.length),
        "autocorrelation": float(mixing.times.max()),
        "effective": float(mixing.effective.min()),
        "acceptance": float(mixing.acceptance),
        "seconds": found.seconds,
        "evaluations": found.evaluations,
    }


def draw(folder: Path, plan: tuple[Posteriors, ...] = PLAN) -> Iterator[str]:
    """Draw what is not in the folder yet, and tell what was drawn."""
    folder.mkdir(parents=True, exist_ok=True)
    fits, pieces = all_fits(), Pieces(folder / "posteriors.jsonl")
    for some in plan:
        for image in some.images:
            for camera, case in fits.cases(some.kind, image):
                if some.kind != "people" and camera not in some.cameras:
                    continue
                name = f"{some.kind}, {image}, {camera}, {some.method}"
                saved = folder / f"{name.replace(', ', '-')}.h5"
                of = partial(drawn, fits, some.kind, some.method, case, image, saved)
                one = pieces.once(name, of)
                yield f"{name}: {one['seconds']:.0f} s, {one['times']:.0f} times"


def main() -> None:
    """Draw, keep the numbers, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where posteriors are kept when they are drawn")
    help_ = "write the tables of what is in the folder, and draw nothing"
    parser.add_argument("--no-draws", action="store_true", help=help_)
    options = parser.parse_args()
    try:
        for line in () if options.no_draws else draw(options.folder):
            print(line, flush=True)
    except KeyboardInterrupt:
        print("interrupted; the same command continues")
        return
    found: dict[str, Any] = {"machine": machine.description(), "posteriors": {}}
    for line in (options.folder / "posteriors.jsonl").read_text().splitlines():
        one = json.loads(line)
        found["posteriors"][one["name"]] = one["run"]
    keep(RESULTS, found, 4)
    write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
