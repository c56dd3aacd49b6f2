"""Coregistration with a model that acts on triangles: with two forms of the energy, side by side.

python -m benchmarks.triangle_scans

The scans are the set with holes of `benchmarks.coregistration`, 30 of them, five of each person.
The model is BlendSCAPE on `default`, whose Q is learned, before stitching, from the skinned body in
poses of the pose prior. Numbers go to `results/triangle-scans.json` and a table into
COREGISTRATION.md.
"""

import argparse
import json
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coregistration import PAGE, PEOPLE, REPORTED, SETS
from benchmarks.keeping import keep, write_between
from benchmarks.machine import description
from examples.studies.simulated_scans import START, Apart, ScannedSet, errors, scanned_set
from workbench import load_body
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration.coregistration import Fitted
from workbench.registration.coregistration.triangle_steps import learned_bends
from workbench.registration.coregistration.triangles import TriangleCoregistration, TrianglePlan
from workbench.training.execution import Execution, Executor, Processes

RESULTS = Path(__file__).parent / "results" / "triangle-scans.json"
BEGIN = "<!-- written by `python -m benchmarks.triangle_scans` -->"
END = "<!-- triangles: up to here -->"
SCANS, POSES, RATIO = 30, 60, 0.02
CONTROL = "equal rounds, model unchanged"
PLAN = TrianglePlan(rounds=3)
METHODS = {
    CONTROL: replace(PLAN, blocks=()),
    "coregistration, lambda_C = 1 (both forms)": PLAN,
    "lambda_C = 1/4, on the coupling alone": replace(PLAN, weight=0.25, symmetric=False),
    "lambda_C = 1/4, on all priors": replace(PLAN, weight=0.25),
    "lambda_C = 4, on the coupling alone": replace(PLAN, weight=4.0, symmetric=False),
    "lambda_C = 4, on all priors": replace(PLAN, weight=4.0),
}


def starting_body() -> TriangleBody:
    """BlendSCAPE on the body from which coregistration starts, with a Q before stitching."""
    skinned = load_body(START)
    poses = draw_poses(shipped_gaussian(), POSES, np.random.default_rng(5))
    poses[:, 0] = 0
    return learned_bends(blend_scape(skinned), poses, skinned.vertices(poses), RATIO)


def one(given: ScannedSet, alone: list[dict[str, Any]], plan: TrianglePlan) -> dict[str, Any]:
    """Errors in mm by scan, the joint cost after each block, and seconds."""
    began = time.perf_counter()
    fits = [Fitted(each["pose"], each["betas"], each["trans"]) for each in alone]
    V = np.stack([each["vertices"] for each in alone])
    state = TriangleCoregistration(starting_body(), given.scans, plan).run(fits, V)
    found = errors(given, state.vertices)
    found["costs"] = [sum(entry.after.values()) for entry in state.log]
    return found | {"seconds": time.perf_counter() - began}


def table(found: dict[str, Any]) -> str:
    """As Markdown."""
    lines = ["| | seen | hidden | along the skin | across it |", "| --- | --: | --: | --: | --: |"]
    for name, rows in found["methods"].items():
        means = [np.mean(rows[k]) for k in ("seen", "hidden", "tangential", "normal")]
        lines.append(f"| {name} | " + " | ".join(f"{m:.2f}" for m in means) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    executor: Executor = Processes(parser.parse_args().jobs)
    given = scanned_set(REPORTED, PEOPLE, SCANS, *SETS["holes"])
    jobs = [(given.scans, j, start) for j, start in enumerate(given.starts)]
    alone = list(Execution(executor).executor(Apart(0), jobs))
    methods = {
        "separate, by the vertex model": errors(given, np.stack([a["vertices"] for a in alone]))
    }
    each = executor(partial(one, given, alone), METHODS.values())
    for name, found in zip(METHODS, each, strict=True):
        methods[name] = found
        print(name, {k: round(float(np.mean(v)), 2) for k, v in found.items()}, flush=True)
    known = {"scans": SCANS, "people": PEOPLE, "methods": methods, "machine": description()}
    keep(RESULTS, known, 5)
    write_between(PAGE, BEGIN, END, table(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
