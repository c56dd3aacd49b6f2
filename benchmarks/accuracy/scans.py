"""The command `python -m benchmarks.registration`: bodies fitted to simulated scans, against truth.

`python -m benchmarks.registration RECORDING` fits `default` to scans of people in poses of a
recording that are held out of the pose prior (`held_out_poses`), with shapes outside
of the body's shape space, and judges every fit by the truth. Numbers go to `results/`, and the
tables of REGISTRATION.md are written from them.
"""

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.comparison.statistics import rate
from workbench.fitting import Scan, pose_prior, shape_prior
from workbench.priors.recordings import held_out_poses
from workbench.problem import Problem
from workbench.registration import SEEN_STAGES, ModelFit, doubts, fit_model, support
from workbench.residuals.contacts import Form, distance, offset
from workbench.residuals.scans import scan_to_model
from workbench.solvers import TrustRegion
from workbench.synthetic import Clutter, Holes, Noise, SimulatedScan, people, scan, scanners

HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results" / "registration.json", HERE / "REGISTRATION.md"
BEGIN = "<!-- from here on written by `python -m benchmarks.registration` -->"
END = "<!-- up to here -->"
GOOD = 20.0  # mm, mean over the vertices: a fit that is not farther off has succeeded
OWN_SHAPE, NOISE, STEEPEST = 0.005, 0.002, 1.4  # m, m, rad
SEEN = "1 view, camera known"
SCENES = {  # the number of views, and whether the fit is told of normals and of the camera
    "4 views": (4, True, False),
    "4 views, no normals": (4, False, False),
    "1 view": (1, True, False),
    SEEN: (1, True, True),
}
LIMIT = 1_000  # iterations of one run of a form
SET = 60  # seeds, which a row of the table has


def scanned(body: SkinnedBody, poses: Array, seed: int, views: int) -> SimulatedScan:
    """A scan of a person in a held-out pose, from a random direction."""
    person = people(body, poses, 1, seed, own_shape=OWN_SHAPE)[0]
    turn = float(np.random.default_rng((seed, 7)).uniform(-np.pi, np.pi))
    around = scanners(views, target=person.vertices.mean(axis=0), turn=turn)
    return scan(
        person.vertices,
        body.faces,
        around,
        seed=seed,
        noise=Noise(growth=0.0, floor=NOISE),
        holes=Holes(),
        clutter=Clutter(),
        steepest=STEEPEST,
        made_of=person.values,
    )


def judged(
    body: SkinnedBody, poses: Array, seed: int, views: int, normals: bool, known_camera: bool
) -> dict[str, Any]:
    """One fit, its error against the truth, and what is said about it without the truth."""
    simulated = scanned(body, poses, seed, views)
    given = simulated.scan
    if not normals:
        given = Scan(given.points, weights=given.weights)
    camera = simulated.scanners[0].place if views == 1 else None
    begin = time.process_time()
    if known_camera:
        fit = fit_model(body, given, camera=camera, stages=SEEN_STAGES, seed=seed)
    else:
        fit = fit_model(body, given, seed=seed)
    took = time.process_time() - begin
    known = support(fit)
    found = doubts(fit, known, camera=camera)
    error = 1e3 * np.linalg.norm(fit.vertices() - simulated.skin, axis=1)
    there = simulated.seen
    return {
        "seed": seed,
        "error": float(error.mean()),
        "seen": float(error[there].mean()),
        "hidden": float(error[~there].mean()) if (~there).any() else None,
        "CPU seconds": took,
        "iterations": fit.iterations,
        "warnings": list(found),
        "expected": 1e3 * float(np.sqrt(np.mean(known.sd**2))),
        "gap": _gap(fit),
    }


def _gap(fit: ModelFit) -> list[float]:
    """By which shares the costs of other hypotheses exceed the best, and how far off they are."""
    best = fit.vertices()
    return [
        x
        for k, one in enumerate(fit.hypotheses[1:], start=1)
        for x in (
            (one.cost - fit.cost) / fit.cost,
            1e3 * float(np.linalg.norm(fit.vertices(k) - best, axis=1).mean()),
        )
    ]


def forms(body: SkinnedBody, poses: Array, seeds: Sequence[int]) -> dict[str, list[int]]:
    """Iterations until convergence of two forms of the same cost, from starts 0.1 rad off."""
    found: dict[str, list[int]] = {"distance": [], "offset": []}
    for seed in seeds:
        simulated = scanned(body, poses, seed, 4)
        truth = simulated.made_of
        assert truth is not None
        rng = np.random.default_rng((seed, 8))
        start = {**truth, "pose": truth["pose"] + 0.1 * rng.standard_normal(truth["pose"].shape)}
        some = rng.permutation(np.flatnonzero(~simulated.clutter))[:1000]
        for form in (distance, offset):
            found[form.name].append(_run(body, simulated.scan.points[some], form, start))
    return found


def _run(body: SkinnedBody, points: Array, form: Form, start: Values) -> int:
    pose, betas, trans = (block.symbol for block in body.blocks())
    data = scan_to_model(
        body.points(pose, betas, trans), body.faces, points, sigma=0.005, form=form, name="scan"
    )
    problem = Problem((data, pose_prior(body), shape_prior(body)), ("pose", "betas", "trans"))
    end = TrustRegion(max_iterations=LIMIT, gradient_tolerance=1e-4).solve(problem, start)
    return len(end.trace) - 1


def table(scenes: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Successes with exact 95 % intervals, errors, times and warnings of each scene."""
    lines = [
        "| scans | within 20 mm (95 %) | mean of these, mm | seen / hidden, mm | worst, mm "
        "| CPU s, median / most | warned of those that fail | warned of the others |",
        "| --- | --: | --: | --: | --: | --: | --: | --: |",
    ]
    for name, runs in scenes.items():
        good = [run for run in runs if run["error"] <= GOOD]
        bad = [run for run in runs if run["error"] > GOOD]
        times = [run["CPU seconds"] for run in runs]
        mean, seen, hidden = (
            np.mean([run[what] for run in good if run[what] is not None])
            for what in ("error", "seen", "hidden")
        )
        lines.append(
            f"| {name} | {_share(len(good), len(runs))} | {mean:.1f} | {seen:.1f} / {hidden:.1f} | "
            f"{max(run['error'] for run in runs):.0f} | {np.median(times):.1f} / {max(times):.1f} "
            f"| {_share(_warned(bad), len(bad))} | {_share(_warned(good), len(good))} |"
        )
    return "\n".join(lines) + "\n"


def _warned(runs: Sequence[Mapping[str, Any]]) -> int:
    return sum(bool(run["warnings"]) for run in runs)


def _share(k: int, n: int) -> str:
    """k of n, and between which shares it lies."""
    if not n:
        return "0 of 0"
    found = rate(k, n)
    return f"{k} of {n} ({100 * found.low:.0f} to {100 * found.high:.0f} %)"


def sets(scenes: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, list[Mapping[str, Any]]]:
    """The runs of each scene in sets of 60, in the order of their seeds, which have no gaps."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for name, runs in scenes.items():
        for first in range(0, len(runs), SET):
            some = list(runs[first : first + SET])
            found[f"{name}, seeds {some[0]['seed']} to {some[-1]['seed']}"] = some
    return found


def page(results: Mapping[str, Any]) -> str:
    """The tables, as Markdown."""
    text = "\n" + table(sets(results["scenes"]))
    found = results.get("forms")
    if found:
        text += (
            f"\nIterations to convergence, median over {len(found['distance'])} scans: "
            f"{np.median(found['distance']):g} by the distance, "
            f"{np.median(found['offset']):g} by the offset "
            f"(at most {LIMIT:,} were allowed).\n"
        )
    return text


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for, keep the numbers, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.registration", description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--first", type=int, default=0, help="seed; 200 and more are for tuning")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--forms", type=int, default=0, help="number of scans for both forms")
    parser.add_argument("--dry", action="store_true", help="print, and write nothing")
    asked = parser.parse_args(arguments)
    body, poses = load_body("default"), held_out_poses(asked.recording)
    seeds = range(asked.first, asked.first + asked.count)
    runs: dict[str, dict[int, dict[str, Any]]] = {}
    for name in asked.scenes:
        runs[name] = {}
        for seed in seeds:
            runs[name][seed] = judged(body, poses, seed, *SCENES[name])
            print(name, json.dumps(runs[name][seed]), flush=True)
    both = forms(body, poses, range(asked.first, asked.first + asked.forms)) if asked.forms else {}
    known: dict[str, Any] = {"scenes": {}}
    if RESULTS.exists() and not asked.dry:
        known = json.loads(RESULTS.read_text())
    for name, more in runs.items():
        kept = {run["seed"]: run for run in known["scenes"].get(name, [])} | more
        known["scenes"][name] = [kept[seed] for seed in sorted(kept)]
    if both:
        known["forms"] = both
    print(page(known))
    if not asked.dry:
        keep(RESULTS, known | {"machine": machine.description()}, 5)
        write_between(PAGE, BEGIN, END, page(known))


if __name__ == "__main__":
    main()
