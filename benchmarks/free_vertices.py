"""Registration with free vertices on simulated scans, against the truth and against trimesh.

python -m benchmarks.free_vertices             # 12 scans on which nothing was tuned, 4 views
python -m benchmarks.free_vertices --views 2   # the same people, seen by two scanners
python -m benchmarks.free_vertices --tuning    # terms, couplings and the peer's settings
python -m benchmarks.free_vertices --full      # time and memory of an iteration on `full`

Numbers go to `results/free-vertices.json`, and REGISTRATION.md is written from them.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.keeping import keep, write_between
from benchmarks.machine import description
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.fitting import Scan
from workbench.geometry.surface_tree import SurfaceTree
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import (
    QUICK_VERTEX_STAGES,
    VERTEX_STAGES,
    FreeVertices,
    VertexStage,
    by_vertices,
)
from workbench.registration.free_vertices import MODEL_STAGES, NEAR
from workbench.solvers import Iterate
from workbench.synthetic import (
    Clutter,
    Holes,
    Joining,
    Noise,
    ScannedPerson,
    SimulatedScan,
    people,
    scan,
    scanners,
)

HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results" / "free-vertices.json", HERE / "REGISTRATION.md"
BEGIN = "<!-- from here on written by `python -m benchmarks.free_vertices` -->"
END = "<!-- up to here: free vertices -->"
REPORTED, TUNED_ON = range(12), range(100, 106)
OWN_SHAPE = 0.006  # m rms, what no betas reach
VIEWS, GROWTH, CLUTTER = 4, 5e-4, 0.1  # 2 mm of noise at 2 m
POSE_OFF, TRANS_OFF = 0.05, 0.01  # rad, m: how far from the truth the model fit begins
MM = 1e3
GOOD = 20.0  # mm, mean over the vertices: the model is not where the scan is beyond that
Method = Callable[[Values, Array], Array]  # from the model fit, its values and vertices (N, 3) m
PEER = "trimesh nricp_amberg"
# The peer's settings, chosen on seeds 100 to 102 among stiffness 0.006 to 2 at first, four steps
# down to a tenth or six down to a thirtieth, weights of normals 0 to 5, and reaches 0.0025 to 0.03
SMOOTH, NORMAL = 10.0, 2.0
REACH = 0.0025  # of the body's size
PEER_STEPS = tuple(0.02 * np.geomspace(1, 1 / 30, 6))  # stiffness of its steps, each times SMOOTH
POINTS, STEPS = 40_000, 5  # of the scan of `full`, and iterations on it
FULL = {"model held": QUICK_VERTEX_STAGES[-1], "model follows": VERTEX_STAGES[-1]}


@dataclass(frozen=True, eq=False)
class Case:
    """A person, its scan, and where the model fit begins."""

    body: SkinnedBody
    person: ScannedPerson
    simulated: SimulatedScan
    start: Values

    def errors(self, vertices: Array) -> dict[str, float]:
        """Mean errors of vertices and of the scan's own points, in mm."""
        off = MM * np.linalg.norm(vertices - self.person.vertices, axis=1)
        seen, own = self.simulated.seen, ~self.simulated.clutter
        tree = SurfaceTree(vertices, self.body.faces)
        away = tree.closest(self.simulated.scan.points[own]).distances
        return {
            "seen": float(off[seen].mean()),
            "hidden": float(off[~seen].mean()),
            "all": float(off.mean()),
            "scan to surface": float(MM * np.abs(away).mean()),
        }


def case(body: SkinnedBody, poses: Array, seed: int, views: int = VIEWS) -> Case:
    """The person and the scan of one seed."""
    person = people(body, poses[seed % len(poses)][None], 1, seed, own_shape=OWN_SHAPE)[0]
    simulated = scan(
        person.vertices,
        body.faces,
        scanners(views, height=0.3, target=person.vertices.mean(axis=0)),
        seed=seed,
        noise=Noise(growth=GROWTH),
        holes=Holes(),
        clutter=Clutter(CLUTTER),
        steepest=np.radians(80),
        joining=Joining(),
    )
    rng = np.random.default_rng((seed, 5))
    pose, betas, trans = (person.values[name] for name in ("pose", "betas", "trans"))
    start = {
        "pose": pose + POSE_OFF * rng.standard_normal(pose.shape),
        "betas": np.zeros_like(betas),
        "trans": trans + TRANS_OFF * rng.standard_normal(3),
    }
    return Case(body, person, simulated, start)


def staged(one: Case, stages: Sequence[VertexStage], fit: FreeVertices) -> Method:
    """Ours from the model fit."""
    after = tuple(stages[len(MODEL_STAGES) :])
    return lambda values, _: fit.register(values, after).vertices


def peer(one: Case, smooth: float, normal: float, reach: float = REACH) -> Method:
    """trimesh's, from the same model fit onto the same scan, as a mesh: it takes closest places on
    triangles, in which clutter has no part.
    """
    import trimesh.registration

    steps = [[smooth * stiff, 0.0, normal, 10] for stiff in PEER_STEPS]

    def register(_: Values, vertices: Array) -> Array:
        scanned = one.simulated.scan
        source = trimesh.Trimesh(vertices, one.body.faces, process=False)
        target = trimesh.Trimesh(scanned.points, scanned.faces, process=False)
        return np.asarray(
            trimesh.registration.nricp_amberg(source, target, steps=steps, distance_threshold=reach)
        )

    return register


def reported(one: Case) -> dict[str, Method]:
    """The methods of the table."""
    edges = FreeVertices(one.body, one.simulated.scan)
    weakest = replace(QUICK_VERTEX_STAGES[-1], coupling=0.005)
    return {
        "edges, model follows": staged(one, VERTEX_STAGES, edges),
        "edges, model held": staged(one, QUICK_VERTEX_STAGES, edges),
        "edges, term of the model": staged(
            one, (*MODEL_STAGES, replace(VERTEX_STAGES[-1], term=NEAR)), edges
        ),
        "vertices, model held": staged(
            one, (*QUICK_VERTEX_STAGES[:-1], weakest), replace(edges, couple=by_vertices)
        ),
        PEER: peer(one, SMOOTH, NORMAL),
    }


def tuning(one: Case) -> dict[str, Method]:
    """What is chosen on other scans."""
    edges = FreeVertices(one.body, one.simulated.scan)
    found: dict[str, Method] = {}
    for outlier in (0.006, 0.01):
        for facing in (0.3, 0.5, 0.8):
            term = replace(NEAR, outlier=outlier, facing=facing)
            chosen = (*VERTEX_STAGES[:-1], replace(VERTEX_STAGES[-1], term=term))
            found[f"edges, outliers {MM * outlier:g} mm, {facing:g}"] = staged(one, chosen, edges)
    for sigma in (0.005, 0.01, 0.015):
        for name, stages in (("follows", VERTEX_STAGES), ("held", QUICK_VERTEX_STAGES)):
            chosen = (*stages[:-1], replace(stages[-1], coupling=sigma))
            found[f"edges, {name}, {MM * sigma:g} mm"] = staged(one, chosen, edges)
    for sigma in (0.0025, 0.005, 0.01):
        chosen = (*QUICK_VERTEX_STAGES[:-1], replace(QUICK_VERTEX_STAGES[-1], coupling=sigma))
        by = replace(edges, couple=by_vertices)
        found[f"vertices, held, {MM * sigma:g} mm"] = staged(one, chosen, by)
    for smooth in (0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
        for normal in (0.0, 0.5, 2.0, 5.0):
            for reach in (0.0025, 0.005, 0.01, 0.03):
                named = f"{PEER}, {smooth:g}, {normal:g}, {reach:g}"
                found[named] = peer(one, smooth, normal, reach)
    return found


def measured(
    seeds: Sequence[int], methods: Callable[[Case], dict[str, Method]], views: int = VIEWS
) -> Iterator[dict[str, Any]]:
    """Every method on the scan of every seed."""
    body = load_body("default")
    poses = draw_poses(shipped_gaussian(), 200, np.random.default_rng(7))
    for seed in seeds:
        one = case(body, poses, seed, views)
        began = time.process_time()
        model = FreeVertices(body, one.simulated.scan).register(one.start, MODEL_STAGES)
        row: dict[str, Any] = {"seed": seed, "points": one.simulated.scan.n_points}
        seconds = time.process_time() - began
        row["model"] = one.errors(model.vertices) | {"seconds": seconds}
        for name, method in methods(one).items():
            began = time.process_time()
            vertices = method(model.values, model.vertices)
            seconds = time.process_time() - began
            row[name] = one.errors(vertices) | {"seconds": seconds}
        print(
            seed,
            {k: [round(x, 2) for x in v.values()] for k, v in row.items() if isinstance(v, dict)},
            flush=True,
        )
        yield row


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Means over the scans, and on how many each method is nearer to the truth than the peer."""
    names = [name for name, entry in rows[0].items() if isinstance(entry, dict)]
    found: dict[str, Any] = {}
    for name in names:
        found[name] = {k: float(np.mean([row[name][k] for row in rows])) for k in rows[0][name]}
        found[name]["seen, of the model's (median)"] = float(
            np.median([row[name]["seen"] / row["model"]["seen"] for row in rows])
        )
        if PEER in names:
            better = [row[name]["all"] < row[PEER]["all"] for row in rows]
            found[name]["nearer than the peer"] = int(np.sum(better))
    return found


def scan_of_full() -> tuple[FreeVertices, Values]:
    """A scan of a person with the topology of `full`, and values near it."""
    body, rng = load_body("full"), np.random.default_rng(0)
    poses = draw_poses(shipped_gaussian(), 1, np.random.default_rng(7))
    person = people(body, poses, 1, 3, own_shape=OWN_SHAPE)[0]
    corners = person.vertices[body.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    on = rng.choice(len(areas), POINTS, p=areas / areas.sum())
    points = np.einsum("mk,mki->mi", rng.dirichlet((1, 1, 1), POINTS), corners[on])
    points += 0.002 * rng.standard_normal(points.shape)
    each = np.full(POINTS, areas.sum() / POINTS)
    values = {name: np.array(person.values[name]) for name in ("pose", "betas", "trans")}
    values["pose"] = values["pose"] + 0.02 * rng.standard_normal(values["pose"].shape)
    return FreeVertices(
        body, Scan(points, normals[on] / (2 * areas[on, None]), weights=each)
    ), values


def of_an_iteration(name: str) -> dict[str, float]:
    """CPU seconds of the iterations on `full`, and the largest memory of this process in MB."""
    import resource

    fit, values = scan_of_full()
    ends: list[float] = []

    def noted(_: Iterate) -> bool:
        ends.append(time.process_time())
        return len(ends) > STEPS

    stage = FULL[name]
    problem = fit.problem(stage)
    values["vertices"] = fit.body.vertices(*(values[part] for part in ("pose", "betas", "trans")))
    solution = stage.solver.solve(problem, values, callback=noted)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "seconds": (ends[-1] - ends[0]) / (len(ends) - 1),
        "most": float(np.diff(ends).max()),
        "iterations": len(ends) - 1,
        "unknowns": problem.free.size,
        "MB": peak / 1024,
        "fall": solution.trace[0].cost / solution.cost,
    }


def full() -> dict[str, dict[str, float]]:
    """`of_an_iteration` in processes of their own."""
    found = {}
    for name in FULL:
        command = [sys.executable, "-m", "benchmarks.free_vertices", "--iteration", name]
        ran = subprocess.run(command, check=True, capture_output=True, text=True)
        found[name] = json.loads(ran.stdout.splitlines()[-1])
        print(name, found[name], flush=True)
    return found


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Errors of each method, as medians over the scans with the least and the largest."""
    lines = [
        "| | seen, mm | hidden, mm | scan to surface, mm | seen, of the model's | hidden, of the "
        "model's | nearer than the peer (all vertices) | CPU s |",
        "| --- | --: | --: | --: | --: | --: | --: | --: |",
    ]

    def spread(numbers: Array, digits: int = 1) -> str:
        middle, least, most = (f"{f(numbers):.{digits}f}" for f in (np.median, np.min, np.max))
        return f"{middle} ({least} to {most})"

    for name in (name for name, entry in rows[0].items() if isinstance(entry, dict)):
        of = {k: np.array([row[name][k] for row in rows]) for k in rows[0][name]}
        shares = {k: of[k] / [row["model"][k] for row in rows] for k in ("seen", "hidden")}
        better = sum(row[name]["all"] < row[PEER]["all"] for row in rows)
        lines.append(
            f"| {name} | {spread(of['seen'])} | {spread(of['hidden'])} | "
            f"{spread(of['scan to surface'], 2)} | {spread(shares['seen'], 2)} | "
            f"{spread(shares['hidden'], 2)} | "
            + ("" if name == PEER else f"{better} of {len(rows)}")
            + f" | {spread(of['seconds'])} |"
        )
    return "\n".join(lines) + "\n"


def page(found: dict[str, Any]) -> str:
    """The tables, as Markdown."""
    text = ""
    for views, one in sorted(found.get("views", {}).items(), reverse=True):
        rows = one["scans"]
        wrong = sum(row["model"]["all"] > GOOD for row in rows)
        text += (
            f"\n{len(rows)} scans by {views} scanners; median (least to largest). {wrong} of the "
            f"fits of the model are more than {GOOD:g} mm off:\n\n{table(rows)}"
        )
    if found.get("full"):
        text += (
            f"\nOne iteration on `full` with {POINTS:,} points, mean of the first {STEPS}, each "
            "stage in a process of its own:\n\n"
            "| | unknowns | CPU s | longest | peak memory, MB |\n| --- | --: | --: | --: | --: |\n"
        )
        for name, one in found["full"]["stages"].items():
            text += (
                f"| {name} | {one['unknowns']:,} | {one['seconds']:.2f} | {one['most']:.2f} | "
                f"{one['MB']:.0f} |\n"
            )
    return text


def main() -> None:
    """Measure, print and, except when tuning, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--views", type=int, default=VIEWS)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--iteration", choices=list(FULL))
    given = parser.parse_args()
    if given.iteration:
        print(json.dumps(of_an_iteration(given.iteration)))
        return
    known: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if given.full:
        known["full"] = {"machine": description(), "stages": full()}
    else:
        seeds, methods = (TUNED_ON, tuning) if given.tuning else (REPORTED, reported)
        rows = list(measured(seeds, methods, given.views))
        found = summary(rows)
        for name, entry in found.items():
            print(f"{name:32}", "  ".join(f"{k} {v:.3g}" for k, v in entry.items()))
        if given.tuning:
            return
        one = {"machine": description(), "summary": found, "scans": rows}
        known["views"] = known.get("views", {}) | {str(given.views): one}
    keep(RESULTS, known, 5)
    write_between(PAGE, BEGIN, END, page(known))


if __name__ == "__main__":
    main()
