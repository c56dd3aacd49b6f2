"""The command `python -m benchmarks.images.video`: `balance` as a video, against four cameras.

Each of the four cameras alone, fitted frame by frame and together. The truth is the fit to all
four cameras, frame by frame. Settings were chosen on frames 0 to 44; frames 55 to 99 were not
looked at before; the frames between keep both apart by 0.17 s.
"""

import argparse
import json
import resource
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.images.limbs import limbs, mpjpe
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.experiments.balance import balance, balance_clip, published
from workbench.fitting.setup import Setup
from workbench.fitting.videos import EVIDENCE, landmarks_of, video_fit, video_mean
from workbench.geometry.rotation import matrix_from_vector
from workbench.problem import Problem
from workbench.solvers import TrustRegion

HERE = Path(__file__).parents[1]
RESULTS, PAGE = HERE / "results" / "images-video.json", HERE / "VIDEO.md"
PARTS = {"tuning": range(45), "report": range(55, 100), "whole": range(100)}
SOLVER = TrustRegion(max_iterations=30, gradient_tolerance=1e-3)


def by_four_cameras(body: SkinnedBody, frames: Sequence[int]) -> list[Values]:
    """Pose, betas and trans of the fits to four cameras."""
    found = []
    for frame in frames:
        setup = balance(frame)
        values = {**setup.start, **TrustRegion().solve(setup.problem, setup.start).values}
        found.append({block.name: values[block.name] for block in body.blocks()})
    return found


def truth(body: SkinnedBody, frames: Sequence[int]) -> tuple[Array, Array]:
    """Limb landmarks (T, 12, 3) m and statures (T,) mm of the fits to four cameras."""
    found = by_four_cameras(body, frames)
    places = [limbs(body, body.landmark("coco", *one.values())) for one in found]
    return np.array(places), np.array([stature(body, one["betas"]) for one in found])


def stature(body: SkinnedBody, betas: Array) -> float:
    """The height of the body at rest, mm."""
    return 1e3 * float(np.ptp(body.vertices(betas=betas)[:, 1]))


def acceleration(places: Array) -> float:
    """The mean second difference, mm a frame squared."""
    return 1e3 * float(np.linalg.norm(np.diff(places, 2, axis=0), axis=-1).mean())


def spread(body: SkinnedBody, problem: Problem, values: Values, frame: int) -> dict[str, float]:
    """Laplace's standard deviations of stature and of the depth in one frame, mm."""
    here = problem.linearize(values)
    free, betas = problem.free, values["betas"]
    directions = np.zeros((free.size, 2))
    size, at = 1e-3, free.slices["betas"]
    steps = size * np.eye(len(betas))
    middle = stature(body, betas)
    directions[at, 0] = [(stature(body, betas + step) - middle) / size for step in steps]
    depth = looking(problem, values)
    directions[free.slices["trans"].start + 3 * frame + np.arange(3), 1] = 1e3 * depth
    solved = here.inverse_times(directions)
    assert solved is not None
    tall, deep = np.sqrt(np.sum(directions * solved, axis=0))
    return {"stature": float(tall), "depth": float(deep)}


def looking(problem: Problem, values: Values) -> Array:
    """The direction (3,) in which the one camera looks."""
    name = next(n for n in problem.known if n.endswith("/rotation"))
    return matrix_from_vector(values[name])[2]


def fitted(setup: Setup, solver: TrustRegion = SOLVER) -> tuple[Values, float]:
    """The values at the end, and CPU seconds."""
    begin = time.process_time()
    solution = solver.solve(setup.problem, setup.start)
    return {**setup.start, **solution.values}, time.process_time() - begin


def judged(body: SkinnedBody, camera: str, frames: Sequence[int], known: Any) -> dict[str, Any]:
    """One camera alone: frame by frame, together, and together with frames taken as independent."""
    true, tall = (one[list(frames)] for one in known)
    rows: dict[str, Any] = {"camera": camera}
    begin = time.process_time()
    clip = balance_clip(frames, (camera,))
    setup = video_fit(clip, body, "Which motion is it?")
    started = time.process_time() - begin
    moving = setup.moving
    assert moving is not None
    apart, likeliest = [alone(body, camera, frame) for frame in frames], setup.start
    for name, worth in (("together", None), ("independent", float(len(frames)))):
        if worth is not None:
            setup.start[EVIDENCE] = np.ones(1)
        values, seconds = fitted(setup)
        likeliest = values if worth is None else likeliest
        found = limbs(body, landmarks_of(moving, values))
        sd = spread(body, setup.problem, values, len(frames) // 2)
        off = 1e3 * (found - true)[len(frames) // 2].mean(axis=0)
        rows[name] = {
            "mpjpe": mpjpe(found, true),
            "acceleration": acceleration(found),
            "absolute": 1e3 * float(np.linalg.norm(found - true, axis=-1).mean()),
            "stature": stature(body, values["betas"]) - float(tall.mean()),
            "stature sd": sd["stature"],
            "depth": float(off @ looking(setup.problem, values)),
            "depth sd": sd["depth"],
            "worth": float(setup.start[EVIDENCE][0] * len(frames)),
            "CPU seconds": started + seconds,
        }
    found = np.array([one[0] for one in apart])
    rows["apart"] = {
        "mpjpe": mpjpe(found, true),
        "acceleration": acceleration(found),
        "absolute": 1e3 * float(np.linalg.norm(found - true, axis=-1).mean()),
        "stature": float(np.mean([one[1] for one in apart]) - tall.mean()),
        "CPU seconds": sum(one[2] for one in apart),
    }
    rows["mean"] = averaged(body, setup, likeliest, true)
    rows["truth acceleration"] = acceleration(true)
    return rows


def averaged(body: SkinnedBody, setup: Setup, values: Values, true: Array) -> dict[str, float]:
    """The mean of the posterior in place of the likeliest motion; CPU seconds are its own."""
    assert setup.moving is not None
    begin = time.process_time()
    mean = video_mean(setup, values)
    seconds = time.process_time() - begin
    found = limbs(body, landmarks_of(setup.moving, mean))
    return {
        "mpjpe": mpjpe(found, true),
        "acceleration": acceleration(found),
        "absolute": 1e3 * float(np.linalg.norm(found - true, axis=-1).mean()),
        "CPU seconds": seconds,
    }


def alone(body: SkinnedBody, camera: str, frame: int) -> tuple[Array, float, float]:
    """One frame from scratch, by the same terms and stages: landmarks, stature, CPU seconds."""
    begin = time.process_time()
    setup = video_fit(balance_clip([frame], (camera,)), body, "Which pose is it?")
    values, _ = fitted(setup)
    assert setup.moving is not None
    found = limbs(body, landmarks_of(setup.moving, values))[0]
    return found, stature(body, values["betas"]), time.process_time() - begin


def limits(body: SkinnedBody, camera: str, true: list[Values]) -> dict[str, dict[str, float]]:
    """One camera's fit to the frames PARTS["report"], its cost and MPJPE in mm: from the usual
    start, from the fits to four cameras, and both with the shape held at the median of these.
    """
    setup = video_fit(balance_clip(PARTS["report"], (camera,)), body, "Which motion is it?")
    assert setup.moving is not None
    places = limbs(body, np.array([body.landmark("coco", *one.values()) for one in true]))
    betas = np.median([one["betas"] for one in true], axis=0)
    known = {name: np.array([one[name] for one in true]) for name in ("pose", "trans")}
    shaped = setup.problem.freeing(*(name for name in setup.problem.free.names if name != "betas"))
    told = {}
    for name, problem, start in (
        ("usual start", setup.problem, {}),
        ("from the truth", setup.problem, known | {"betas": betas}),
        ("usual start, shape known", shaped, {"betas": betas}),
        ("from the truth, shape known", shaped, known | {"betas": betas}),
    ):
        begun = setup.start | start
        solution = SOLVER.solve(problem, begun)
        found = limbs(body, landmarks_of(setup.moving, begun | solution.values))
        told[name] = {"cost": solution.cost, "mpjpe": mpjpe(found, places)}
    return told


def limits_table(found: dict[str, dict[str, dict[str, float]]]) -> str:
    """MPJPE and cost of every camera's fits."""
    names = list(next(iter(found.values())))
    lines = [f"| camera | {' | '.join(names)} |", "| --- |" + " --: |" * len(names)]
    for camera, each in found.items():
        cells = (f"{each[name]['mpjpe']:.1f} ({each[name]['cost']:.1f})" for name in names)
        lines.append(f"| {camera} | {' | '.join(cells)} |")
    return "\n".join(lines)


def step(body: SkinnedBody) -> dict[str, float]:
    """One iteration at 200 frames: CPU seconds, and by how much the process grew, MB."""
    frames = [*range(100), *range(99, -1, -1)]
    setup = video_fit(balance_clip(frames, ("cam01",)), body, "How long does it take?")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    setup.problem.linearize(setup.start).step(1e-3)
    begin = time.process_time()
    for _ in range(5):
        setup.problem.linearize(setup.start).step(1e-3)
    seconds = (time.process_time() - begin) / 5
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {"CPU seconds": seconds, "MB": (after - before) / 1024}


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The cameras of one part."""
    columns = [
        *("apart", "together", "mean", "independent", "ratio", "ratio of mean"),
        *("acceleration", "stature", "CPU s", "CPU s of mean"),
    ]
    lines = [f"| camera | {' | '.join(columns)} |", "| --- |" + " --: |" * len(columns)]
    for row in rows:
        a, b, m, c = (row[name] for name in ("apart", "together", "mean", "independent"))
        lines.append(
            f"| {row['camera']} | {a['mpjpe']:.1f} | {b['mpjpe']:.1f} | {m['mpjpe']:.1f} "
            f"| {c['mpjpe']:.1f} | {b['mpjpe'] / a['mpjpe']:.2f} | {m['mpjpe'] / a['mpjpe']:.2f} "
            f"| {b['acceleration']:.1f} | {b['stature']:+.0f} (sd {b['stature sd']:.0f}) "
            f"| {b['CPU seconds']:.1f} | {m['CPU seconds']:.1f} |"
        )
    return "\n".join(lines)


def marks(part: str) -> tuple[str, str]:
    """Between these lines of the page the command writes the table of a part."""
    return (
        f"<!-- {part}: written by `python -m benchmarks.images.video` -->",
        f"<!-- {part}: end -->",
    )


def means(rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """The mean distances over the cameras of one part, mm."""
    names = "apart", "together", "mean", "independent"
    return {name: float(np.mean([row[name]["mpjpe"] for row in rows])) for name in names}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, keep the numbers, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.images.video", description=__doc__)
    parser.add_argument("--parts", nargs="*", default=list(PARTS), choices=list(PARTS))
    parser.add_argument("--limits", action="store_true", help="nothing but the table of limits")
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    asked = parser.parse_args(arguments)
    body = load_body("default")
    if asked.limits:
        seen_by_four = by_four_cameras(body, PARTS["report"])
        told = {str(one): limits(body, str(one), seen_by_four) for one in published()["camera"]}
        print(limits_table(told))
        if not asked.dry:
            keep(RESULTS, json.loads(RESULTS.read_text()) | {"limits": told}, 4)
            kept = json.loads(RESULTS.read_text())["limits"]
            write_between(PAGE, *marks("limits"), limits_table(kept))
        return
    found: dict[str, Any] = {"step": step(body)}
    print(json.dumps(found), flush=True)
    known = truth(body, range(100))
    for part in asked.parts:
        cameras = [str(name) for name in published()["camera"]]
        found[part] = [judged(body, camera, PARTS[part], known) for camera in cameras]
        print(part, json.dumps(found[part]), flush=True)
        print(table(found[part]), flush=True)
    if not asked.dry:
        before = json.loads(RESULTS.read_text())
        keep(RESULTS, before | found | {"machine": machine.description()}, 4)
        kept = json.loads(RESULTS.read_text())
        for part in asked.parts:
            write_between(PAGE, *marks(part), table(kept[part]))


if __name__ == "__main__":
    main()
