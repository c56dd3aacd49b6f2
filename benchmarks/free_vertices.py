"""Registration with free vertices on simulated scans, against the truth and against trimesh.

python -m benchmarks.free_vertices             # 12 scans on which nothing was tuned
python -m benchmarks.free_vertices --tuning    # couplings and the peer's settings, other scans
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import description
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.geometry.surface_tree import SurfaceTree
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.registration import FreeVertices, VertexStage, by_vertices
from workbench.registration.free_vertices import MODEL_STAGES, QUICK_VERTEX_STAGES, VERTEX_STAGES
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

RESULTS = Path(__file__).parent / "results" / "free-vertices.json"
REPORTED, TUNED_ON = range(12), range(100, 103)
OWN_SHAPE = 0.006  # m rms, what no betas reach
VIEWS, GROWTH, CLUTTER = 4, 5e-4, 0.1  # 2 mm of noise at 2 m
POSE_OFF, TRANS_OFF = 0.05, 0.01  # rad, m: how far from the truth the model fit begins
MM = 1e3
Method = Callable[[Values, Array], Array]  # from the model fit, its values and vertices (N, 3) m
PEER = "trimesh nricp_amberg"
SMOOTH, NORMAL = 3.0, 0.0  # the peer's settings, not tuned yet: choose them by --tuning
REACH = 0.03  # of the body's size
PEER_STEPS = (0.02, 0.01, 0.005, 0.002)  # stiffness of its steps, each times SMOOTH


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


def case(body: SkinnedBody, poses: Array, seed: int) -> Case:
    """The person and the scan of one seed."""
    person = people(body, poses[seed % len(poses)][None], 1, seed, own_shape=OWN_SHAPE)[0]
    simulated = scan(
        person.vertices,
        body.faces,
        scanners(VIEWS, height=0.3, target=person.vertices.mean(axis=0)),
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


def peer(one: Case, smooth: float, normal: float) -> Method:
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
            trimesh.registration.nricp_amberg(source, target, steps=steps, distance_threshold=REACH)
        )

    return register


def reported(one: Case) -> dict[str, Method]:
    """The methods of the table."""
    edges = FreeVertices(one.body, one.simulated.scan)
    weakest = replace(QUICK_VERTEX_STAGES[-1], coupling=0.005)
    return {
        "edges, model follows": staged(one, VERTEX_STAGES, edges),
        "edges, model held": staged(one, QUICK_VERTEX_STAGES, edges),
        "edges, weak at once": staged(one, (*MODEL_STAGES, VERTEX_STAGES[-1]), edges),
        "vertices, model held": staged(
            one, (*QUICK_VERTEX_STAGES[:-1], weakest), replace(edges, couple=by_vertices)
        ),
        PEER: peer(one, SMOOTH, NORMAL),
    }


def tuning(one: Case) -> dict[str, Method]:
    """What is chosen on other scans."""
    edges = FreeVertices(one.body, one.simulated.scan)
    found: dict[str, Method] = {}
    for sigma in (0.01, 0.015):
        for name, stages in (("follows", VERTEX_STAGES), ("held", QUICK_VERTEX_STAGES)):
            chosen = (*stages[:-1], replace(stages[-1], coupling=sigma))
            found[f"edges, {name}, {MM * sigma:g} mm"] = staged(one, chosen, edges)
    for sigma in (0.0025, 0.005, 0.01):
        chosen = (*QUICK_VERTEX_STAGES[:-1], replace(QUICK_VERTEX_STAGES[-1], coupling=sigma))
        by = replace(edges, couple=by_vertices)
        found[f"vertices, held, {MM * sigma:g} mm"] = staged(one, chosen, by)
    for smooth in (0.3, 1.0, 3.0, 10.0, 30.0):
        for normal in (0.0, 0.5):
            found[f"{PEER}, {smooth:g}, {normal:g}"] = peer(one, smooth, normal)
    return found


def measured(
    seeds: Sequence[int], methods: Callable[[Case], dict[str, Method]]
) -> Iterator[dict[str, Any]]:
    """Every method on the scan of every seed."""
    body = load_body("default")
    poses = draw_poses(shipped_gaussian(), 200, np.random.default_rng(7))
    for seed in seeds:
        one = case(body, poses, seed)
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


def main() -> None:
    """Measure, print and, except when tuning, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuning", action="store_true")
    given = parser.parse_args()
    rows = list(measured(*((TUNED_ON, tuning) if given.tuning else (REPORTED, reported))))
    found = summary(rows)
    for name, entry in found.items():
        print(f"{name:32}", "  ".join(f"{k} {v:.3g}" for k, v in entry.items()))
    if not given.tuning:
        document = {"machine": description(), "summary": found, "scans": rows}
        RESULTS.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
