"""The command `python -m benchmarks.images.draws FOLDER`: draws of posteriors of one image.

What `benchmarks.images.intervals` takes from Laplace's approximation is drawn here: by Hamiltonian
Monte Carlo, all 85 unknowns at once, and for a few of the same posteriors by emcee as well. Each
posterior is kept in FOLDER as soon as it is drawn, and an ensemble of emcee's every half a minute,
so that the command continues where it was stopped. Numbers go to `results/draws.json`, and the
tables of IMAGES.md are written from them.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

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
from benchmarks.images.one_posterior import by_emcee, by_hamiltonian, compiled_places, summary
from benchmarks.keeping import keep, write_between
from benchmarks.posterior.pieces import Pieces, runs_of
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.fitting.images import OFFSET, ByHeight, ImageFits, WithStature, spreads
from workbench.priors.poses import draw_poses, shipped_gaussian


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
    *of_balance("hamiltonian", (0, 80)),
    Posteriors("people", "hamiltonian", tuple(range(6, 10))),
    *of_balance("hamiltonian", (20, 60)),
    Posteriors("people", "hamiltonian", tuple(range(10, 40))),
    Posteriors("known", "emcee", (40,), ("cam03",)),
    *of_balance("emcee", (40,), "cam01"),
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
    return told | summary(found, OFFSET * lever, rng)


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
                saved = folder / f"{name.replace(', ', '-')}.npz"
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
    posteriors = runs_of(options.folder / "posteriors.jsonl")
    found = {"machine": machine.description(), "posteriors": posteriors}
    keep(RESULTS, found, 5)  # means are close to each other
    write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
