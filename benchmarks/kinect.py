"""The command `python -m benchmarks.kinect FILE`: real people seen by a Kinect, points held out.

`FILE` is the one that `examples/26_people_seen_by_a_kinect.py` names, which does not come with the
workbench; settings are those of the example. Half of the points are held out, at random or in whole
blocks of 5 cm. A point drawn at random has neighbours a few millimetres away among those that are
fitted; inside of a block, the body has to bridge what is missing. Numbers go to `results/`, and the
table of REGISTRATION.md is written from them.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.keeping import keep, write_between
from workbench import load_body
from workbench.arrays import Array, Mask
from workbench.bodies import SkinnedBody
from workbench.fitting import boundary, read_scan
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import FreeVertices, fit_model

EXAMPLE = import_module("examples.26_people_seen_by_a_kinect")
HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results" / "kinect.json", HERE / "REGISTRATION.md"
BEGIN = "<!-- from here on written by `python -m benchmarks.kinect` -->"
END = "<!-- up to here: Kinect -->"
PEOPLE = ("person_a", "person_b", "person_c")
BLOCK = 0.05  # m, the edge of the cubes whose points are held out together
WAYS = {"at random": 1, "blocks of 5 cm": 2}  # how often each is drawn


def at_random(points: Array, seed: int) -> Mask:
    """Which of the points (M, 3) are fitted: every other one, by a coin."""
    return np.asarray(np.random.default_rng(seed).random(len(points)) < 0.5)


def in_blocks(points: Array, seed: int) -> Mask:
    """The same by a coin for each cube of 5 cm, of a grid in a random place."""
    rng = np.random.default_rng(seed)
    cells = np.floor((points + rng.uniform(0, BLOCK, 3)) / BLOCK).astype(int)
    _, block = np.unique(cells, axis=0, return_inverse=True)
    block = block.ravel()
    return np.asarray((rng.random(block.max() + 1) < 0.5)[block])


def measured(
    path: Path, name: str, way: str, seed: int, body: SkinnedBody, stages: Sequence[Any]
) -> tuple[dict[str, Any], dict[str, Array]]:
    """One person, fitted to half of the points: medians of distances in mm.

    And the distances (H,) m of all held-out points, from the model and from the registration.
    """
    read = read_scan(path, name=name)
    points = read.scan.points
    inner, judged = (
        ~boundary(read.scan, width=width) for width in (EXAMPLE.BORDER, EXAMPLE.MEASURED)
    )
    fitted = {"at random": at_random, "blocks of 5 cm": in_blocks}[way](points, seed)
    begin = time.process_time()
    fit = fit_model(body, read.scan, keep=inner & fitted, stages=stages)
    known = read.scan.some(inner & fitted)
    done = FreeVertices(body, known).register(fit.values, EXAMPLE.VERTEX_STAGES)
    took = time.process_time() - begin
    camera = np.zeros(3) if read.camera_position is None else read.camera_position
    found: dict[str, Any] = {
        "person": name,
        "held out": way,
        "seed": seed,
        "points": int((judged & ~fitted).sum()),
        "from the camera": float(np.median(np.linalg.norm(points - camera, axis=1))),
        "CPU seconds": took,
    }
    held_out: dict[str, Array] = {}
    for what, vertices in (("model", fit.vertices()), ("registered", done.vertices)):
        tree = SurfaceTree(vertices, body.faces)
        for which, some in (("held out", judged & ~fitted), ("fitted", judged & fitted)):
            off = np.abs(tree.closest(points[some]).distances)
            found[f"{what}, {which}"] = 1e3 * float(np.median(off))
            held_out.setdefault(what, off)
    return found, held_out


def pooled(distances: Mapping[tuple[str, int], Sequence[Mapping[str, Array]]]) -> list[Any]:
    """The medians in mm over the held-out points of all people together, for each way and seed."""
    rows = []
    for (way, seed), people in distances.items():
        together = {what: np.concatenate([one[what] for one in people]) for what in people[0]}
        medians = {what: 1e3 * float(np.median(off)) for what, off in together.items()}
        rows.append({"held out": way, "seed": seed, "points": len(together["model"]), **medians})
    return rows


def table_of_pooled(rows: Sequence[Mapping[str, Any]]) -> str:
    """One row for each half of all people."""
    lines = [
        "| all people together, held out | points | model, mm | registered, mm |",
        "| --- | --: | --: | --: |",
    ]
    for row in rows:
        lines.append(
            f"| {row['held out']} | {row['points']:,} | {row['model']:.1f} "
            f"| {row['registered']:.1f} |"
        )
    return "\n".join(lines) + "\n"


def table(runs: Sequence[Mapping[str, Any]]) -> str:
    """One row for each person and half."""
    lines = [
        "| person, from the camera | held out | points | model, mm | registered, mm "
        "| fitted points: model, mm | registered, mm |",
        "| --- | --- | --: | --: | --: | --: | --: |",
    ]
    for run in runs:
        lines.append(
            f"| {run['person'][-1]}, {run['from the camera']:.2f} m | {run['held out']} "
            f"| {run['points']:,} | {run['model, held out']:.1f} "
            f"| {run['registered, held out']:.1f} | {run['model, fitted']:.1f} "
            f"| {run['registered, fitted']:.1f} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure all people, keep the numbers, and write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kinect", description=__doc__)
    parser.add_argument("file", type=Path)
    asked = parser.parse_args(arguments)
    body, runs = load_body("default"), []
    away: dict[tuple[str, int], list[dict[str, Array]]] = {}
    for name in PEOPLE:
        for way, times in WAYS.items():
            for seed in range(times):
                run, off = measured(asked.file, name, way, seed, body, EXAMPLE.FIT_STAGES)
                runs.append(run)
                away.setdefault((way, seed), []).append(off)
                print(table(runs[-1:]).splitlines()[-1], flush=True)
    together = pooled(away)
    keep(RESULTS, {"runs": runs, "pooled": together, "machine": machine.description()}, 4)
    write_between(PAGE, BEGIN, END, f"\n{table(runs)}\n{table_of_pooled(together)}")


if __name__ == "__main__":
    main()
