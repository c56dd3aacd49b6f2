"""The command `python -m benchmarks.images.one_camera [RECORDING]`: one image, against the truth.

The person of `balance`, whom four cameras saw, is fitted to one of them; the truth is the fit to
all four. With a recording of motion capture, synthetic people in poses that are held out of the
priors (`held_out_poses`) are fitted as well, with and without gross outliers among
their keypoints. Numbers go to `results/images.json`, and the tables of IMAGES.md are written from
them.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.images.limbs import limbs, mean_distance, mpjpe
from benchmarks.keeping import keep, write_between
from workbench import load_body, solve
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.comparison.statistics import rate
from workbench.errors import check_known
from workbench.experiments.balance import observations
from workbench.fitting import keypoint_fit, photograph
from workbench.fitting.body_priors import POSE_PRIOR
from workbench.fitting.images import (
    ByHeight,
    ImageFits,
    WithStature,
    image_mean,
    image_priors,
    smplify,
)
from workbench.fitting.keypoints import KeypointProblem, alike, keypoint_setup
from workbench.fitting.observations import Observations
from workbench.fitting.setup import Setup
from workbench.geometry.camera import Camera
from workbench.geometry.rigid import umeyama
from workbench.geometry.rotation import matrix_from_vector
from workbench.priors.recordings import held_out_poses
from workbench.residuals import Residual
from workbench.sampling import posterior_mean
from workbench.solvers import Solution

HERE = Path(__file__).parent.parent
RESULTS, PAGE = HERE / "results" / "images.json", HERE / "IMAGES.md"
BEGIN = "<!-- from here on written by `python -m benchmarks.images.one_camera` -->"
END = "<!-- up to here -->"
FAILED = 150.0  # mm: a fit that is farther off on average
REPORTED = range(0, 100, 4)  # frames of `balance`; recipes were chosen on 2, 10, ..., 98
SPREAD = range(0, 100, 8)  # frames by which the standard deviations of the mean are judged
STATURE = 1.72  # m, of the person of `balance`, by the fits to four cameras
PEOPLE = 200
NOISE = 5.0  # px
SIGMA = 4.0  # px, of all rows but one
BY_HEIGHT = "regressed start, sigma by height"  # what a fit has unless another sigma is given
STRICT = 0.035  # of the height, from which on keypoints are outliers, in one of the recipes
OUTLIERS, FAR = 4, 150.0  # how many keypoints are wrong, and by how many px
TITLES = {
    "balance": "The person of `balance`, one camera",
    "people": f"{PEOPLE} synthetic people, {NOISE:g} px of noise",
    "outliers": f"The same people, {OUTLIERS} keypoints {FAR:g} px off",
}


@dataclass(frozen=True, eq=False)
class Case:
    """One image: what was observed, what was held out, and the true landmarks (M, 3) m; `made_of`
    are pose, betas and trans of the true body.
    """

    observed: Observations
    held_out: tuple[str, ...]
    truth: Array
    made_of: Values | None = None


Fit = Callable[[Case], tuple[Solution, Setup]]


def as_before(body: SkinnedBody) -> Fit:
    """The fit without a robust kernel and stages."""
    of = KeypointProblem(body)

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = keypoint_setup(of, case.observed, "", case.held_out)
        return solve(setup.problem, setup.start), setup

    return fit


def in_stages(fits: ImageFits, hypotheses: int = 1) -> Fit:
    """The fit by a recipe."""

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = fits.setup(case.observed, "", hypotheses=hypotheses, held_out=case.held_out)
        assert setup.strategy is not None
        return setup.strategy(None).solve(setup.problem, setup.start), setup

    return fit


def averaged(fits: ImageFits) -> Fit:
    """The same, and then the mean of the posterior in place of its mode."""
    likeliest = in_stages(fits)

    def fit(case: Case) -> tuple[Solution, Setup]:
        solution, setup = likeliest(case)
        mean = posterior_mean(setup.problem, setup.start | solution.values)
        return replace(solution, values=mean.values), setup

    return fit


def from_the_truth(fits: ImageFits) -> Fit:
    """The last stage of a recipe alone, from where the synthetic person is."""

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = fits.setup(case.observed, "", held_out=case.held_out)
        assert case.made_of is not None
        return ByHeight().solver.solve(setup.problem, setup.start | case.made_of), setup

    return fit


def half(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """The terms of an image with a pose prior that counts half."""
    return tuple(one.weighed(0.5) if one.name == POSE_PRIOR else one for one in image_priors(body))


def balance_cases(body: SkinnedBody, frames: Iterable[int] = REPORTED) -> Iterator[Case]:
    """Each camera alone, in each of these frames."""
    for frame in frames:
        observed, _ = observations(frame)
        whole = keypoint_fit(observed, body, "")
        values = solve(whole.problem, whole.start).values
        known = {block.name: values[block.name] for block in body.blocks()}
        truth = body.landmark("coco", *known.values())
        names = [photo.name for photo in observed.photographs]
        for name in names:
            yield Case(observed, tuple(other for other in names if other != name), truth, known)


def synthetic_cases(body: SkinnedBody, poses: Array, seeds: range, outliers: int) -> Iterator[Case]:
    """A person in a held-out pose, seen from a random direction at a height of 400 to 900 px."""
    names = body.landmark_names("coco")
    for seed in seeds:
        rng = np.random.default_rng((seed, 27))
        pose = poses[rng.integers(len(poses))]
        betas = rng.normal(size=body.n_betas)
        values = {"pose": pose, "betas": betas, "trans": np.zeros(3)}
        values["trans"] = -body.joints(pose, betas).mean(axis=0)
        focal, size = 1200.0, 1100
        depth = focal * 1.7 / rng.uniform(400, 900)
        up = np.diag([1.0, -1.0, -1.0])
        tilt = matrix_from_vector([rng.uniform(-0.1, 0.4), 0.0, 0.0])
        R = tilt @ up @ matrix_from_vector([0.0, rng.uniform(-np.pi, np.pi), 0.0])
        K = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
        lens = Camera("c/").values(K=K, R=R, t=(0, 0, depth))
        truth = body.landmark("coco", *values.values())
        pixels = Camera("c/").pixels(truth, lens)
        pixels = pixels + NOISE * rng.normal(size=pixels.shape)
        wrong = rng.choice(len(names), outliers, replace=False)
        turn = rng.uniform(0, 2 * np.pi, outliers)
        pixels[wrong] += FAR * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.column_stack([pixels, np.ones(len(pixels))])
        shot = photograph("one", (size, size), points, {"K": K, "R": R, "t": [0, 0, depth]})
        yield Case(Observations(tuple(names), (shot,)), (), truth, values)


def errors(found: Array, truth: Array) -> dict[str, float]:
    """Mean distances in mm of limbs (12, 3) m: from the middle of the hips, after Procrustes, and
    in space.
    """
    return {
        "MPJPE": mpjpe(found, truth),
        "PA": mean_distance(umeyama(found, truth)(found), truth),
        "absolute": mean_distance(found, truth),
    }


def measured(body: SkinnedBody, fit: Fit, cases: list[Case]) -> dict[str, Any]:
    """Errors of all cases and CPU milliseconds; the first case is fitted twice, to warm up."""
    each: dict[str, list[float]] = {"MPJPE": [], "PA": [], "absolute": [], "ms": []}
    for case in [cases[0], *cases]:
        began = time.process_time()
        solution, _ = fit(case)
        took = 1e3 * (time.process_time() - began)
        found = body.landmark("coco", *(solution.values[block.name] for block in body.blocks()))
        told = errors(limbs(body, found), limbs(body, case.truth)) | {"ms": took}
        for name, value in told.items():
            each[name].append(value)
    return {name: values[1:] for name, values in each.items()}


def spread(body: SkinnedBody) -> dict[str, float]:
    """How many times as far landmarks of the mean are from the truth as `image_mean` says, their
    middles brought together: root mean square over the images and landmarks, and the least and the
    largest of a landmark.
    """
    fit, off, said = in_stages(ImageFits(body)), [], []
    for case in balance_cases(body, SPREAD):
        solution, setup = fit(case)
        mean = image_mean(setup, setup.start | solution.values)
        apart = mean.landmarks - case.truth
        off.append(np.sum((apart - apart.mean(axis=0)) ** 2, axis=1))
        said.append(mean.sd**2)
    each = np.sqrt(np.mean(off, axis=0) / np.mean(said, axis=0))
    whole = float(np.sqrt(np.mean(off) / np.mean(said)))
    ends = {"least": float(each.min()), "largest": float(each.max())}
    return {"images": len(off), "ratio": whole, **ends}


def run(recording: Path | None, only: Sequence[str] | None = None) -> dict[str, Any]:
    """All tables, by name and recipe, or some recipes alone."""

    def asked(fits: dict[str, Fit]) -> dict[str, Fit]:
        return {name: fit for name, fit in fits.items() if only is None or name in only}

    body = load_body("default")
    found: dict[str, Any] = {"balance": {}, "people": {}, "outliers": {}}
    found["machine"] = machine.description()
    in_px = partial(ByHeight, sigma=SIGMA)  # as when most rows were measured
    fits = ImageFits(body, in_px())
    tall = ImageFits(body, in_px(priors=WithStature(STATURE)))
    recipes: dict[str, Fit] = {
        "as before": as_before(body),
        "regressed start": in_stages(fits),
        "regressed start and one at rest": in_stages(fits, 2),
        "regressed start, mean of the posterior": averaged(fits),
        BY_HEIGHT: in_stages(ImageFits(body)),
        "regressed start, a wide stage": in_stages(ImageFits(body, in_px(wide=(0.047,)))),
        "regressed start, all keypoints alike": in_stages(ImageFits(body, in_px(relative=alike))),
        "regressed start, pose prior half": in_stages(ImageFits(body, in_px(priors=half))),
        "regressed start, outliers from 3.5 % on": in_stages(ImageFits(body, in_px(strict=STRICT))),
        "SMPLify's weights and stages": in_stages(ImageFits(body, smplify)),
    }
    cases = list(balance_cases(body))
    on_balance = recipes | {
        "regressed start, stature known": in_stages(tall),
        "regressed start, stature known, mean": averaged(tall),
    }
    on_people = recipes | {"from the truth": from_the_truth(fits)}
    for name in only or ():
        check_known("row", name, on_balance | on_people)
    for name, fit in asked(on_balance).items():
        found["balance"][name] = measured(body, fit, cases)
        print("balance", name, line(found["balance"][name]), flush=True)
    if recording is None:
        return found
    poses = held_out_poses(recording)
    for scene, outliers in (("people", 0), ("outliers", OUTLIERS)):
        cases = list(synthetic_cases(body, poses, range(PEOPLE), outliers))
        for name, fit in asked(on_people).items():
            found[scene][name] = measured(body, fit, cases)
            print(scene, name, line(found[scene][name]), flush=True)
    return found


def line(found: dict[str, list[float]]) -> str:
    """The cells of a row of a table."""
    n = len(found["MPJPE"])
    failed = sum(value > FAILED for value in found["MPJPE"])
    share = rate(failed, n)
    cells = [f"{np.mean(found[name]):.1f}" for name in ("MPJPE", "PA", "absolute")]
    cells.append(f"{100 * failed / n:.1f} % ({100 * share.low:.0f} to {100 * share.high:.0f})")
    cells.append(f"{np.median(found['ms']):.0f}")
    return " | ".join(cells)


def tables(found: dict[str, Any]) -> str:
    """The tables of the page."""
    head = "MPJPE, mm | PA, mm | in space, mm | above 150 mm (95 %) | CPU ms"
    lines = []
    for scene, title in TITLES.items():
        if not found[scene]:
            continue
        n = len(next(iter(found[scene].values()))["MPJPE"])
        lines += ["", f"{title} ({n} fits):", "", f"| fit | {head} |"]
        lines += ["| --- | --: | --: | --: | --: | --: |"]
        lines += [f"| {name} | {line(each)} |" for name, each in found[scene].items()]
    if "spread" in found:
        ratio, least, largest = (f"{found['spread'][n]:.1f}" for n in ("ratio", "least", "largest"))
        lines += [
            "",
            f"On {found['spread']['images']} images of `balance`, landmarks of the mean were "
            f"{ratio} times as far from the truth as their standard deviations say ({least} to "
            f"{largest} times, by landmark).",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run, keep the numbers, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, nargs="?", help="motion capture (.npz)")
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    parser.add_argument("--only", nargs="+", help="some rows alone; the others stay what they were")
    parser.add_argument("--spread", action="store_true", help="nothing but what the mean's sd say")
    options = parser.parse_args()
    before = json.loads(RESULTS.read_text())
    if options.spread:
        found = {"spread": spread(load_body("default"))}
        print(json.dumps(found))
    else:
        found = run(options.recording, options.only)
        if options.only:
            for scene in TITLES:
                found[scene] = before[scene] | found[scene]
            found["machine"], found["of rows alone"] = before["machine"], found["machine"]
    if not options.dry:
        keep(RESULTS, before | found, 4)
        write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
