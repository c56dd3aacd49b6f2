"""Intervals from one camera, and a truth that they were not told.

The truth is the estimate from four cameras, or one that was drawn from the prior and photographed
with the very sigma (`simulated`). Three intervals of the same 16 entries (orientation, betas,
place):

- `emcee`: draws of the 16, all other entries at the truth. If truth and keypoints come from the
  model, these intervals hold it at their level, whatever the other entries are: they are
  conditioned on, not guessed.
- `NUTS`: draws of all 85, of which the 16 are looked at. Ensembles do not mix in 85 dimensions.
- `Laplace`: the Gaussian approximation to all 85.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.stats

import workbench as wb
from benchmarks.posterior.nuts import NutsSettings, nuts
from workbench.arrays import Array, Index
from workbench.blocks.layout import entries
from workbench.experiments.balance import balance, balance_monocular, published
from workbench.fitting.setup import View
from workbench.priors.poses import shipped_gaussian
from workbench.sampling import fixed, sample
from workbench.sampling.modes import Mode
from workbench.threads import limited_threads

Interval = dict[str, Any]  # `ends` (2, 16), `mean`, `sd`, `usable`, and what else is known
NAMES = ("pose[pelvis]", "betas", "trans")
LEVEL = 0.9
SIGMA = 4.0  # px, of the experiment
ROOT, PLACE = 0.3, 0.3  # rad, m: priors of the simulated orientation and place
NUTS = NutsSettings(draws=400, warm=400, accepted=0.9)
WALKERS = 40
STEPS = 16_000  # of emcee's walkers, at most
EVERY = 4  # cases: NUTS
NEARLY = 1.05  # R-hat: intervals' ends are then known well enough to be counted


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with a truth: what one camera saw, and what all entries were."""

    name: str
    problem: wb.Problem
    truth: wb.Values  # and what is fixed

    @property
    def places(self) -> Index:
        """Of the 16 entries among all."""
        return entries(self.problem.free, NAMES)


def frames(count: int) -> list[int]:
    """So many, over the whole recording."""
    return [int(f) for f in np.linspace(0, len(published()["keypoints"]) - 1, count)]


def photographed(
    view: View, points: Array, truth: wb.Values, rng: np.random.Generator
) -> wb.Values:
    """The truth with what a camera sees of its points (M, 3), give or take the very sigma."""
    pixels = view.camera.pixels(points, truth)
    confidence = truth[f"{view.name}/confidence"]
    spread = SIGMA / np.where(confidence > 0, confidence, 1.0)[:, None]
    return truth | {f"{view.name}/observed": pixels + spread * rng.standard_normal(pixels.shape)}


@dataclass(frozen=True, eq=False)
class Seen:
    """What four cameras leave of their keypoints at the estimate that they give together."""

    residuals: Array  # (4, 2 M) px, confidences included
    known: int  # rows that have a say
    spent: float  # of them, on the unknowns: trace of J_d (J'J)^-1 J_d'
    sd: Array  # (n,) of the unknowns, by Laplace


def recorded(chosen: Sequence[int], sigma: float) -> Iterator[tuple[Case, Seen]]:
    """Each frame with the four cameras' estimate."""
    one = balance(sigma=sigma, held_out=["cam02", "cam03", "cam04"], compared=()).problem
    four = balance(sigma=sigma, compared=()).problem
    rows = [four.rows[name] for name in four.rows if name.startswith("keypoints")]
    for frame in chosen:
        start = balance(frame, compared=()).start
        truth = start | wb.solve(four, start).values
        here = four.linearize(truth)
        data = np.concatenate([here.jacobian[some] for some in rows])
        yield (
            Case(f"frame {frame}", one, truth),
            Seen(
                sigma * np.array([here.residual[some] for some in rows]),
                int(np.count_nonzero(abs(data).any(axis=1))),
                float(np.trace(data @ here.covariance @ data.T)),
                np.sqrt(np.diag(here.covariance)),
            ),
        )


def simulated(chosen: Sequence[int], seed: int = 0) -> Iterator[Case]:
    """Made up: truths from the prior, keypoints from them, noise of the very sigma.

    Orientation and place, which have no prior in the experiment, get one about the recorded ones.
    Camera and confidences are those of the frames.
    """
    setup = balance_monocular()
    body = setup.body
    assert body is not None
    pose, _, trans = body.blocks()
    about = wb.solve(setup.problem, setup.start).values
    root, place = about["pose"][0], about["trans"]
    added = [
        wb.residuals.gaussian(
            pose.symbol[:, 0], mean=root, covariance=ROOT**2, unit="rad", name="root"
        ),
        wb.residuals.gaussian(
            trans.symbol, mean=place, covariance=PLACE**2, unit="m", name="place"
        ),
    ]
    blocks = setup.problem.fixed.blocks
    # truths are drawn from the priors, and knees and elbows that bend backwards are no draws
    kept = [one for one in setup.problem.residuals if one.name != "bending"]
    problem = wb.Problem([*kept, *added], setup.problem.free.names, blocks=blocks)
    prior = shipped_gaussian()
    view = next(view for view in setup.views if not view.held_out)
    for frame in chosen:
        rng = np.random.default_rng([seed, frame])
        start = balance_monocular(frame).start
        turns = rng.multivariate_normal(prior.mean, prior.covariance).reshape(-1, 3)
        truth = start | {
            "pose": np.vstack([root + ROOT * rng.standard_normal(3), turns]),
            "betas": rng.standard_normal(body.n_betas),
            "trans": place + PLACE * rng.standard_normal(3),
        }
        found = body.landmark(view.landmarks, *(truth[b.name] for b in body.blocks()))
        yield Case(f"simulated {frame}", problem, photographed(view, found, truth, rng))


def by_emcee(case: Case) -> Interval:
    """The 16, the others at the truth."""
    drawn = sample(case.problem, case.truth, NAMES, rest=fixed, walkers=WALKERS, steps=STEPS)
    return _of(drawn.flat) | {"usable": drawn.mixing.usable, "seconds": drawn.seconds}


def by_nuts(case: Case) -> Interval:
    """The 16 of draws of all."""
    with limited_threads():
        x, given, mode = _answer(case)
        chains, said = nuts(case.problem, x, given, np.arange(len(x)), mode, NUTS, seed=0)
    usable = said["R-hat"] <= NEARLY
    return _of(chains.reshape(-1, len(x))[:, case.places]) | {"usable": usable} | said


def by_laplace(case: Case) -> Interval:
    """The 16 of the Gaussian of all."""
    x, _, mode = _answer(case)
    sd = np.linalg.norm(mode.half, axis=1)[case.places]
    z = x[case.places]
    ends = scipy.stats.norm.ppf([[(1 - LEVEL) / 2], [(1 + LEVEL) / 2]])
    return {"ends": (z + ends * sd).tolist(), "mean": z.tolist(), "sd": sd.tolist(), "usable": True}


def _answer(case: Case) -> tuple[Array, Array, Mode]:
    """The minimum next to the truth, so that no wrong minimum is taken for a wrong interval."""
    at = case.truth | wb.solve(case.problem, case.truth).values
    x, given = case.problem.split(at)
    here = case.problem.linearize_at(x, given)
    return x, given, Mode(x, here.cost, np.linalg.cholesky(here.covariance), 0.0)


def _of(flat: Array) -> Interval:
    tail = (1 - LEVEL) / 2
    ends = np.quantile(flat, [tail, 1 - tail], axis=0)
    return {
        "ends": ends.tolist(),
        "mean": flat.mean(axis=0).tolist(),
        "sd": flat.std(axis=0).tolist(),
    }


WAYS: dict[str, Callable[[Case], Interval]] = {
    "emcee": by_emcee,
    "NUTS": by_nuts,
    "Laplace": by_laplace,
}


def asked(case: Case, place: int, ways: Sequence[str]) -> dict[str, Any]:
    """One case: its truth, and the intervals; NUTS takes its time, and is asked now and then."""
    began = time.perf_counter()
    found = {way: WAYS[way](case) for way in ways if way != "NUTS" or place % EVERY == 0}
    print(
        f"{case.name}: {time.perf_counter() - began:.0f} s, "
        + ", ".join(f"{way} {'' if one['usable'] else 'not '}usable" for way, one in found.items()),
        flush=True,
    )
    truth = case.problem.free.pack(case.truth)[case.places]
    return {"case": case.name, "truth": truth.tolist()} | found


def of_recorded(count: int, sigma: float, ways: Sequence[str]) -> dict[str, Any]:
    """Of frames of the recording."""
    cases, seen = [], []
    for place, (case, left) in enumerate(recorded(frames(count), sigma)):
        cases.append(asked(case, place, ways))
        seen.append(left)
    residuals = np.array([one.residuals for one in seen])
    places = entries(case.problem.free, NAMES)
    return {
        "labels": labels(case.problem),
        "sigma": sigma,
        "cases": cases,
        "sigma of the residuals": implied(seen),
        "sd of four cameras": np.mean([one.sd[places] for one in seen], axis=0).tolist(),
        "share of each camera's residuals that stays": (
            np.mean(residuals.mean(axis=0) ** 2, axis=1) / np.mean(residuals**2, axis=(0, 2))
        ).tolist(),
        "rms of each camera": np.sqrt(np.mean(residuals**2, axis=(0, 2))).tolist(),
    }


def of_simulated(count: int, ways: Sequence[str]) -> dict[str, Any]:
    """Of made-up truths."""
    every = list(simulated(frames(count)))
    return {
        "labels": labels(every[0].problem),
        "sigma": SIGMA,
        "cases": [asked(case, i, ways) for i, case in enumerate(every)],
    }


def labels(problem: wb.Problem) -> list[str]:
    """Of the 16."""
    return [problem.free.label(int(i)) for i in entries(problem.free, NAMES)]


def implied(seen: Sequence[Seen]) -> float:
    """The sigma (px) that would make what is left of the keypoints ordinary."""
    square = sum(float(np.sum(one.residuals**2)) for one in seen)
    return float(np.sqrt(square / sum(one.known - one.spent for one in seen)))
