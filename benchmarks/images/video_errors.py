"""The command `python -m benchmarks.images.video_errors`: what else errors of a video may be.

`video_fit` takes the errors of a detector, which are alike from frame to frame, into account by the
weight n / T of all frames. Here the same fits are made with two other descriptions of them: an
offset o_k ~ N(0, s^2) m of each landmark at rest, the same in all frames, as markers have it; and
noise of the first order in time, AR(1), with x_t = rho x_{t-1} + e_t px in each coordinate beside
white noise, which whitens the errors if it is fitted as well. The truth and the parts are those of
`benchmarks.images.video`.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np

from benchmarks import machine
from benchmarks.images.limbs import limbs, mpjpe
from benchmarks.images.video import PAGE, PARTS, SOLVER, stature, truth
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.blocks import Block, Values
from workbench.bodies import SkinnedBody
from workbench.experiments.balance import FPS, balance_clip, published
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.keypoints import landmark_set, observed_blocks
from workbench.fitting.videos import (
    EVIDENCE,
    FAR,
    PLACE_SIGMA,
    POSE_SIGMA,
    landmarks_of,
    video_fit,
)
from workbench.problem import Problem, sequence
from workbench.residuals import Residual, gaussian, keypoints, smooth
from workbench.residuals.kernels import geman_mcclure, scaled
from workbench.residuals.sequences import Between, Frames

RESULTS = Path(__file__).parents[1] / "results" / "images-video-errors.json"
MARKS = (
    "<!-- errors: written by `python -m benchmarks.images.video_errors` -->",
    "<!-- errors: end -->",
)
OFFSETS, DRIFT = "offsets", "drift"


@dataclass(frozen=True)
class Errors:
    """What the errors of a video's keypoints are taken for.

    Attributes:
        name: what the table calls it.
        offset: the standard deviation of a landmark's offset at rest in m; 0 for none.
        drift: that of noise that is alike from frame to frame in px; 0 for none.
        rho: its correlation from frame to frame.
        sigma: the standard deviation of white noise in px.
        full: whether each frame counts fully, or as the errors at the start suggest.
    """

    name: str
    offset: float = 0.0
    drift: float = 0.0
    rho: float = 0.8
    sigma: float = 4.0
    full: bool = False


TRIED = (
    Errors("as `video_fit`"),
    Errors("offsets, 5 mm", offset=0.005),
    Errors("offsets, 15 mm", offset=0.015),
    Errors("offsets, 30 mm", offset=0.03),
    Errors("offsets, 15 mm, frames count fully", offset=0.015, full=True),
    Errors("AR(1), 8 px, and 4 px white", drift=8.0, full=True),
    Errors("AR(1), 3.5 px, and 2 px white", drift=3.5, sigma=2.0, full=True),
    Errors("AR(1), 8 px, and offsets, 15 mm", offset=0.015, drift=8.0, full=True),
)


def problem_of(
    body: SkinnedBody, given: Values, view: Any, errors: Errors
) -> tuple[Problem, Values]:
    """The problem of one camera's video with these errors, and its start, from that of `video_fit`.

    `view` is the camera with what it observed in T frames.
    """
    kind, T = landmark_set(body), len(view.observed)
    names = body.landmark_names(kind)
    pose, betas, trans = body.blocks()
    offsets, wander = body.offsets(kind), Block(DRIFT, (len(names), 2), "px", names)
    weight = 1.0 if errors.full else float(given[EVIDENCE][0])
    placed = pose.symbol, betas.symbol, trans.symbol
    points = body.landmark_points(kind, *placed, offsets.symbol if errors.offset else None)
    observed, confidence = observed_blocks(view.camera, names)
    data = keypoints(
        points,
        view.camera,
        observed.symbol - wander.symbol if errors.drift else observed.symbol,
        confidence.symbol**2,
        sigma=errors.sigma,
        kernel=scaled(geman_mcclure, FAR / errors.sigma),
        name="keypoints",
    )
    residuals = [data.weighed(weight), pose_prior(body).weighed(weight), shape_prior(body)]
    free, shared = [pose.name, betas.name, trans.name], [betas.name]
    between = [
        smooth(pose.name, sigma=POSE_SIGMA / FPS**2, order=2),
        smooth(trans.name, sigma=PLACE_SIGMA / FPS**2, order=2),
    ]
    links = [weighed(one, weight) for one in between]
    start, blocks = dict(given), [*view.camera.blocks, observed, confidence]
    if errors.offset:
        of = gaussian(offsets.symbol, covariance=errors.offset**2, unit="m", name="offset prior")
        residuals.append(of)
        free.append(offsets.name)
        shared.append(offsets.name)
        blocks.append(offsets)
        start[offsets.name] = np.zeros(offsets.shape)
    if errors.drift:
        free.append(DRIFT)
        links.append(first_order(errors.drift, errors.rho))
        blocks.append(wander)
        start[DRIFT] = np.zeros((T, *wander.shape))
    shared += [block.name for block in view.camera.blocks]
    problem = sequence([Problem(residuals, free, blocks=blocks)] * T, shared=shared, between=links)
    return problem, {name: start[name] for name in problem.known}


def weighed(link: Between, weight: float) -> Between:
    """The residual between frames with this weight."""
    return lambda frames: link(frames).weighed(weight)


def first_order(sd: float, rho: float) -> Between:
    """The prior of AR(1) noise of this standard deviation in px: x_0, and x_t - rho x_{t-1}."""

    def between(frames: Frames) -> Residual:
        block = frames[DRIFT]
        x = cs.reshape(block.symbol, block.symbol.numel() // frames.count, frames.count)
        new = (x[:, 1:] - rho * x[:, :-1]) / np.sqrt(1 - rho**2)
        return Residual("drift prior", cs.vec(cs.horzcat(x[:, :1], new)), sd, "px", blocks=(block,))

    return between


def judged(
    body: SkinnedBody, camera: str, frames: Sequence[int], known: Any, tried: Sequence[Errors]
) -> list[dict[str, Any]]:
    """One camera's frames with each description of errors."""
    true, tall = (one[list(frames)] for one in known)
    setup = video_fit(balance_clip(frames, (camera,)), body, "Which motion is it?")
    moving = setup.moving
    assert moving is not None
    rows = []
    for errors in tried:
        problem, start = problem_of(body, setup.start, moving.views[0], errors)
        begin = time.process_time()
        values = {**start, **SOLVER.solve(problem, start).values}
        seconds = time.process_time() - begin
        found = limbs(body, landmarks_of(moving, values))
        row = {"camera": camera, "errors": asdict(errors), "CPU seconds": seconds}
        row["mpjpe"] = mpjpe(found, true)
        row["stature"] = stature(body, values["betas"]) - float(tall.mean())
        rows.append(row)
        print(errors.name, camera, f"{row['mpjpe']:.1f} mm {row['stature']:+.0f} mm", flush=True)
    return rows


def means(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """By description: the mean over cameras of MPJPE, and the largest error of stature, mm."""
    told = {}
    for errors in TRIED:
        some = [row for row in rows if row["errors"]["name"] == errors.name]
        told[errors.name] = {
            "mpjpe": float(np.mean([row["mpjpe"] for row in some])),
            "stature": float(max(abs(row["stature"]) for row in some)),
        }
    return told


def table(found: dict[str, Any]) -> str:
    """All descriptions, on the frames that were tuned on and on the others."""
    parts = [part for part in ("tuning", "report") if part in found]
    each = {part: means(found[part]) for part in parts}
    cells = " | ".join(f"{part}: MPJPE, mm | stature off by at most, mm" for part in parts)
    lines = [f"| errors | {cells} |", "| --- |" + " --: | --: |" * len(parts)]
    for errors in TRIED:
        some = [each[part][errors.name] for part in parts]
        told = " | ".join(f"{one['mpjpe']:.1f} | {one['stature']:.0f}" for one in some)
        lines.append(f"| {errors.name} | {told} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and write the table."""
    name = "python -m benchmarks.images.video_errors"
    parser = argparse.ArgumentParser(prog=name, description=__doc__)
    parser.add_argument("--parts", nargs="*", default=["tuning", "report"], choices=list(PARTS))
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    asked = parser.parse_args(arguments)
    body = load_body("default")
    known = truth(body, range(100))
    cameras = [str(camera) for camera in published()["camera"]]
    found: dict[str, Any] = {"machine": machine.description()}
    for part in asked.parts:
        each = [judged(body, camera, PARTS[part], known, TRIED) for camera in cameras]
        found[part] = [row for rows in each for row in rows]
    if not asked.dry:
        keep(RESULTS, found, 4)
        write_between(PAGE, *MARKS, table(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
