"""The command `python -m benchmarks.images.intervals [RECORDING]`: are intervals of one image true?

90 % intervals of the distance of the pelvis along the camera's axis, of stature, and of the places
of limbs relative to the pelvis, across the image and along the axis, from one camera. The truth on
`balance` is the fit to four cameras. The standard deviation of a landmark's offset was chosen on
frames 2, 10, ..., 98; the others are reported. `benchmarks.images.draws` draws from some of these
posteriors. Numbers go to `results/intervals.json`, and the tables of IMAGES.md are written from
them.
"""

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

from benchmarks import machine
from benchmarks.images.limbs import limbs, mpjpe
from benchmarks.images.one_camera import (
    NOISE,
    PAGE,
    PEOPLE,
    REPORTED,
    STATURE,
    Case,
    balance_cases,
    synthetic_cases,
)
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.fitting.body_priors import POSE_PRIOR, stature
from workbench.fitting.images import (
    OFFSET,
    Z90,
    ByHeight,
    ImageFits,
    WithStature,
    image_priors,
    spreads,
)
from workbench.fitting.keypoints import Terms
from workbench.fitting.observations import Observations
from workbench.fitting.setup import Setup, View
from workbench.geometry.rotation import matrix_from_vector
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.priors.recordings import held_out_poses
from workbench.residuals import Residual, gaussian

RESULTS = Path(__file__).parent.parent / "results" / "intervals.json"
BEGIN = "<!-- intervals: written by `python -m benchmarks.images.intervals` -->"
END = "<!-- intervals: end -->"
TUNING = range(2, 100, 8)
OFFSETS = 0.0, 0.005, 0.01, 0.015, 0.02  # m
WHAT = "depth", "stature", "across", "along"  # 1, 1, 24 and 12 numbers of a fit
LEVEL = 0.9
SHAPE = "shape prior"


def places_of(body: SkinnedBody, pose: Array, betas: Array, trans: Array) -> Array:
    """The pelvis and the landmarks (N, 1 + M, 3) m of N poses, betas and trans."""
    root = body.joints(pose, betas, trans)[:, :1]
    return np.concatenate([root, body.landmark("coco", pose, betas, trans)], axis=1)


def seen_from(
    body: SkinnedBody, view: View, values: Values, places: Callable[..., Array] | None = None
) -> Callable[..., Array]:
    """Depth and stature, and where the 12 limb landmarks are relative to the pelvis in the axes of
    the camera: a function from N poses, betas and trans to (N, 38) m. `places` computes what
    `places_of` does.
    """
    R = matrix_from_vector(values[view.camera.rotation.name])
    t = values[view.camera.translation.name]
    found = partial(places_of, body) if places is None else places

    def of(pose: Array, betas: Array, trans: Array) -> Array:
        points = found(pose, betas, trans) @ R.T + t
        root = points[:, :1]
        there = limbs(body, points[:, 1:]) - root
        across, along = there[..., :2].reshape(len(pose), -1), there[..., 2]
        return np.hstack([root[:, 0, 2:], stature(body, betas)[:, None], across, along])

    return of


def parts(numbers: Array) -> dict[str, Array]:
    """The numbers (N, 38) of N fits by what they are."""
    ends = np.split(numbers, [1, 2, 26], axis=1)
    return dict(zip(WHAT, ends, strict=True))


def fitted(fits: ImageFits, case: Case, start: Values | None = None) -> tuple[Setup, Values]:
    """The setup of a case, and its solution; from a start of one's own, if it is given."""
    setup = fits.setup(case.observed, "", held_out=case.held_out)
    assert setup.strategy is not None
    begun = setup.start | (start or {})
    return setup, begun | setup.strategy(None).solve(setup.problem, begun).values


def view_of(setup: Setup) -> View:
    """The view that was fitted."""
    return next(view for view in setup.views if not view.held_out)


def measured(
    body: SkinnedBody, fits: ImageFits, cases: Iterable[Case], *, at_truth: bool = False
) -> dict[str, Any]:
    """Errors, Laplace's standard deviations and what offsets add, (N, 38) each, and distances."""
    rows, distances, cameras, residuals, noise = [], [], [], [], []
    for case in cases:
        assert case.made_of is not None
        setup, values = fitted(fits, case, case.made_of if at_truth else None)
        view, of = view_of(setup), seen_from(body, view_of(setup), values)
        found, sd, lever = spreads(setup, view, values, of)
        true = of(*(case.made_of[block.name][None] for block in body.blocks()))[0]
        rows.append((found - true, sd, lever))
        noise.append(noise_of(setup, view, values))
        there = body.landmark("coco", *(values[block.name] for block in body.blocks()))
        distances.append(mpjpe(limbs(body, there), limbs(body, case.truth)))
        cameras.append(view.name)
        off, seen = view.camera.pixels(case.truth, values) - view.observed, view.confidence > 0.2
        px = np.mean(values[view.camera.focal.name]) / (found[0] - rows[-1][0][0])
        residuals.append(off[seen] / px)
    error, sd, lever = np.moveaxis(np.array(rows), 1, 0)
    return {
        "error": error,
        "sd": sd,
        "lever": lever,
        "mpjpe": float(np.mean(distances)),
        "cameras": cameras,
        "noise": float(np.median(noise)),
        "landmarks": float(np.sqrt(np.mean(np.concatenate(residuals) ** 2))),
    }


def noise_of(setup: Setup, view: View, values: Values) -> float:
    """The standard deviation of keypoints in px by what the fit left of them, m rows with |r|^2 and
    the trace h of the matrix that maps errors to their fit: sigma^2 |r|^2 / (m - h).
    """
    name = f"keypoints({view.name})"
    sigma = next(one.sigma for one in setup.problem.residuals if one.name == name)
    here = setup.problem.linearize(values)
    rows = setup.problem.rows[name]
    J, r = here.dense[rows], here.residual[rows]
    left = np.sum(J.any(axis=1)) - np.sum((J @ here.covariance) * J)
    return float(sigma) * float(np.sqrt(r @ r / left))


def judged(found: dict[str, Any], offset: float) -> dict[str, Any]:
    """How many 90 % intervals hold the truth, and by what factor they should be wider for that."""
    error, sd = (parts(found[name]) for name in ("error", "sd"))
    lever, told = parts(found["lever"]), dict[str, Any]()
    for name in WHAT:
        e, s = error[name], np.hypot(sd[name], offset * lever[name])
        z = np.abs(e / s)
        told[name] = {
            "within": int(np.sum(z <= Z90)),
            "of": z.size,
            "bias": float(1e3 * e.mean()),
            "rms": float(1e3 * np.sqrt(np.mean(e**2))),
            "sd": float(1e3 * np.sqrt(np.mean(s**2))),
            "factor": float(np.quantile(z, LEVEL) / Z90),
        }
    return told


def by_camera(found: dict[str, Any], offset: float) -> dict[str, Any]:
    """The distances of each camera alone: intervals that hold the truth, and the bias in mm."""
    names = np.array(found["cameras"])
    some = {
        name: {key: found[key][names == name] for key in ("error", "sd", "lever")}
        for name in sorted(set(found["cameras"]))
    }
    return {name: judged(one, offset)["depth"] for name, one in some.items()}


def seen_as(body: SkinnedBody, case: Case, change: Callable[[str, Array, Array], Array]) -> Case:
    """The case with other keypoints: of the camera, of what was observed, and of the truth's."""
    setup = ImageFits(body).setup(case.observed, "", held_out=case.held_out)
    view = view_of(setup)
    true = view.camera.pixels(case.truth, setup.start)
    names = body.landmark_names("coco")
    observed = case.observed.ordered(names)
    photographs = tuple(
        replace(photo, pixels=change(view.name, view.observed, true))
        if photo.name == view.name
        else photo
        for photo in observed.photographs
    )
    return replace(case, observed=Observations(tuple(names), photographs))


def without_bias(body: SkinnedBody, tuning: list[Case], cases: list[Case]) -> list[Case]:
    """The cases without the mean error of each keypoint in each camera in the tuning frames."""
    errors: dict[str, list[Array]] = {}

    def kept(name: str, seen: Array, true: Array) -> Array:
        errors.setdefault(name, []).append(seen - true)
        return seen

    for case in tuning:
        seen_as(body, case, kept)
    bias = {name: np.median(each, axis=0) for name, each in errors.items()}
    return [seen_as(body, case, lambda name, seen, true: seen - bias[name]) for case in cases]


def wide_pose(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
    """The terms of an image with known stature, and a pose prior three times as wide."""
    of = WithStature(STATURE)(body)
    return tuple(one.weighed(1 / 9) if one.name == POSE_PRIOR else one for one in of)


def known_shape(betas: Array) -> Terms:
    """The terms of an image of a person whose betas are known, each to 0.05."""

    def terms(body: SkinnedBody | TriangleBody) -> tuple[Residual, ...]:
        shape = gaussian(body.blocks()[1].symbol, mean=betas, covariance=0.05**2, name=SHAPE)
        return (*(one for one in image_priors(body) if one.name != SHAPE), shape)

    return terms


def causes(body: SkinnedBody, tuning: list[Case], cases: list[Case]) -> dict[str, Any]:
    """What intervals without offsets are like if the keypoints, or the start, were others."""
    rng = np.random.default_rng(4)
    fits = ImageFits(body, ByHeight(priors=WithStature(STATURE)))

    def noisy(sigma: float) -> list[Case]:
        def change(name: str, seen: Array, true: Array) -> Array:
            return true + sigma * rng.normal(size=true.shape)

        return [seen_as(body, case, change) for case in cases]

    changed = {
        "as measured": cases,
        "as measured, started at the truth": cases,
        "without each keypoint's mean error": without_bias(body, tuning, cases),
        "the true landmarks": noisy(0.0),
        "the true landmarks, 4 px of noise": noisy(4.0),
        "the true landmarks, 10 px of noise": noisy(10.0),
    }
    betas = np.median([case.made_of["betas"] for case in cases if case.made_of], axis=0)
    wide, known = (ImageFits(body, ByHeight(priors=p)) for p in (wide_pose, known_shape(betas)))
    others = {
        "the true landmarks, pose prior three times as wide": (wide, noisy(0.0)),
        "the true landmarks, shape known": (known, noisy(0.0)),
        "as measured, shape known": (known, cases),
    }
    told = {}
    for name, (of, some) in ({n: (fits, c) for n, c in changed.items()} | others).items():
        found = measured(body, of, some, at_truth="started" in name)
        told[name] = judged(found, 0.0) | {"mpjpe": found["mpjpe"]}
        print("causes", name, line(told[name]), flush=True)
    return told


def run(recording: Path | None) -> dict[str, Any]:
    """All numbers."""
    body = load_body("default")
    kinds = {"unknown": ByHeight(), "known": ByHeight(priors=WithStature(STATURE))}
    tuning, report = (list(balance_cases(body, some)) for some in (TUNING, REPORTED))
    told: dict[str, Any] = {"machine": machine.description()}
    for kind, recipe in kinds.items():
        found = measured(body, ImageFits(body, recipe), tuning)
        told[f"tuning, {kind}"] = {f"{1e3 * s:g}": judged(found, s) for s in OFFSETS}
        told["landmarks"] = 1e3 * found["landmarks"]
        found = measured(body, ImageFits(body, recipe), report)
        told[f"report, {kind}"] = {f"{1e3 * s:g}": judged(found, s) for s in (0.0, OFFSET)}
        told[f"noise, {kind}"] = found["noise"]
        told[f"cameras, {kind}"] = by_camera(found, OFFSET)
        for s, one in told[f"report, {kind}"].items():
            print(kind, s, line(one), flush=True)
    told["sigmas"] = {}
    for sigma in (4.0, 7.0, 10.0):
        found = measured(body, ImageFits(body, replace(kinds["known"], sigma=sigma)), tuning)
        told["sigmas"][f"{sigma:g}"] = judged(found, 0.0) | {"mpjpe": found["mpjpe"]}
    told["causes"] = causes(body, tuning, report)
    poses = {"the prior": draw_poses(shipped_gaussian(), 2000, np.random.default_rng(5))}
    if recording is not None:
        poses["a recording"] = held_out_poses(recording)
    told["people"] = {}
    for name, some in poses.items():
        cases = list(synthetic_cases(body, some, range(PEOPLE), 0))
        for started in ("", ", started at the truth"):
            of = ImageFits(body, ByHeight(sigma=NOISE))
            found = measured(body, of, cases, at_truth=bool(started))
            told["people"][name + started] = judged(found, 0.0)
            told["people"][name + started]["noise"] = found["noise"]
            print(name + started, line(told["people"][name + started]), flush=True)
    return told


def share(one: dict[str, Any]) -> str:
    """The share of intervals that hold the truth, in percent."""
    return f"{100 * one['within'] / one['of']:.0f} %"


def line(found: dict[str, Any]) -> str:
    """The cells of a row: shares with the factor by which intervals should be wider."""
    return " | ".join(f"{share(found[name])} ({found[name]['factor']:.2f})" for name in WHAT)


def band(count: int) -> tuple[int, int]:
    """Between which shares in percent 95 % of all counts of true 90 % intervals lie."""
    low, high = (float(binom.ppf(tail, count, LEVEL)) for tail in (0.025, 0.975))
    return round(100 * low / count), round(100 * high / count)


def tables(found: dict[str, Any]) -> str:
    """The tables of the page."""
    head = "depth | stature | limbs across | limbs along"
    rule = " --: | --: | --: | --: |"
    lines = []
    for part, title in (("tuning", "Tuning frames"), ("report", "Reported frames")):
        lines += ["", f"{title} of `balance`, by the offset of a landmark:", ""]
        lines += [f"| stature | offset, mm | {head} |", f"| --- | --: |{rule}"]
        for kind in ("unknown", "known"):
            each = found[f"{part}, {kind}"]
            lines += [f"| {kind} | {s} | {line(one)} |" for s, one in each.items()]
    lines += ["", "Depth by camera, with offsets (reported frames, 25 fits each):", ""]
    lines += ["| stature | camera | within (factor) | bias, mm | rms, mm | sd, mm |"]
    lines += ["| --- | --- | --: | --: | --: | --: |"]
    for kind in ("unknown", "known"):
        for name, one in found[f"cameras, {kind}"].items():
            cells = f"{share(one)} ({one['factor']:.2f}) | {one['bias']:+.0f}"
            cells += f" | {one['rms']:.0f} | {one['sd']:.0f}"
            lines.append(f"| {kind} | {name} | {cells} |")
    rest = "bias of depth, mm | MPJPE, mm |"
    lines += ["", "Causes (reported frames, stature known, no offsets):", ""]
    lines += [f"| keypoints | {head} | {rest}", f"| --- |{rule} --: | --: |"]
    for name, one in found["causes"].items():
        cells = f"{line(one)} | {one['depth']['bias']:+.0f} | {one['mpjpe']:.1f}"
        lines.append(f"| {name} | {cells} |")
    lines += ["", "A larger sigma in the fit instead (tuning frames, stature known):", ""]
    lines += [f"| sigma, px | {head} | {rest}", f"| --: |{rule} --: | --: |"]
    for name, one in found["sigmas"].items():
        cells = f"{line(one)} | {one['depth']['bias']:+.0f} | {one['mpjpe']:.1f}"
        lines.append(f"| {name} | {cells} |")
    low, high = band(PEOPLE)
    lines += ["", f"{PEOPLE} synthetic people (true intervals: {low} to {high} %):", ""]
    lines += [f"| poses of | {head} |", f"| --- |{rule}"]
    lines += [f"| {name} | {line(one)} |" for name, one in found["people"].items()]
    return "\n".join(lines[1:]) + "\n"


def main() -> None:
    """Run, keep the numbers, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, nargs="?", help="motion capture (.npz)")
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    options = parser.parse_args()
    found = run(options.recording)
    if not options.dry:
        keep(RESULTS, found, 4)
        write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
