"""Rigid registration beside open3d's: the same partial scans, the same starts, the same target.

Without open3d, which is in the extra `bench` and needs the system's libusb-1.0, only our rows are
measured.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.measuring import table
from workbench.arrays import Array
from workbench.bodies.catalogue import load_body
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    GemanMcClure,
    Icp,
    PointCloud,
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
    random_surface_points,
)

PACKAGES = ("open3d",)
SCANS, POINTS, TARGET = 40, 3000, 20_000
NOISE, GATE, SCALE = 0.002, 0.2, 0.02  # m
CLUTTER, AROUND = 0.1, 0.1  # of the points; m beyond the box of the scan
POSE, TURN, SHIFT = 0.15, 25.0, 0.05  # rad a joint; degrees and m from the truth to the start
SEEN = 0.2  # the least cosine between a normal and the direction of the camera
ITERATIONS = 200
MESH, CLOUD = "the mesh", "20,000 points of it"
Register = Callable[[Array, Similarity], Similarity]


class Case:
    """One scan (POINTS, 3) m with its true motion, its start, and the target in both forms."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        body = load_body("default")
        pose = POSE * rng.normal(size=body.template[: len(body.parents)].shape)
        vertices = body.vertices(pose=pose)
        dense, normals = random_surface_points(vertices, body.faces, 6 * POINTS, rng)
        yaw = rng.uniform(-np.pi, np.pi)
        seen = np.flatnonzero(normals @ [np.sin(yaw), 0.0, np.cos(yaw)] > SEEN)[:POINTS]
        right = dense[seen] + NOISE * rng.normal(size=(len(seen), 3))
        self.truth = Similarity(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3))
        low, high = right.min(axis=0) - AROUND, right.max(axis=0) + AROUND
        clutter = rng.uniform(low, high, (round(CLUTTER * len(right)), 3))
        self.seen = self.truth.inverse()(right)  # errors are measured on these
        self.scan = self.truth.inverse()(np.concatenate([right, clutter]))
        axis, way = (x / np.linalg.norm(x) for x in rng.normal(size=(2, 3)))
        R, middle = matrix_from_vector(np.radians(TURN) * axis), right.mean(axis=0)
        self.start = Similarity(R, middle - R @ middle + SHIFT * way).after(self.truth)
        self.surface = SurfaceTree(vertices, body.faces)
        points, directions = random_surface_points(vertices, body.faces, TARGET, rng)
        self.cloud = PointCloud(points, directions)


def ours(case: Case) -> dict[str, Register]:
    """Our forms, by the name of a row."""

    def by(icp: Icp, target: SurfaceTree | PointCloud) -> Register:
        return lambda scan, start: icp.align(scan, target, start).motion

    def icp(step: Any, halvings: int = 5, **more: Any) -> Icp:
        return Icp(step, gate=GATE, max_iterations=ITERATIONS, halvings=halvings, **more)

    robust = GemanMcClure(SCALE)
    surface, cloud = case.surface, case.cloud
    on_mesh = by(icp(distance_gauss_newton), surface)
    to_planes = by(icp(point_to_plane, 0), cloud)
    fine_on_mesh = by(icp(distance_gauss_newton, loss=robust), surface)
    fine_to_planes = by(icp(point_to_plane, 0, loss=robust), cloud)
    return {
        f"ours, distance, {MESH}": on_mesh,
        f"ours, distance, then Geman-McClure, {MESH}": then(on_mesh, fine_on_mesh),
        f"ours, point to plane, {CLOUD}": to_planes,
        f"ours, point to plane, then Geman-McClure, {CLOUD}": then(to_planes, fine_to_planes),
        f"ours, point to point, {CLOUD}": by(icp(point_to_point), cloud),
    }


def then(first: Register, second: Register) -> Register:
    """One registration, and another from where it ended."""
    return lambda scan, start: second(scan, first(scan, start))


def theirs(case: Case) -> dict[str, Register]:
    """open3d's forms; none if it is not installed."""
    try:
        import open3d
    except ImportError:
        return {}
    of = open3d.pipelines.registration

    def cloud(points: Array) -> Any:
        made = open3d.geometry.PointCloud()
        made.points = open3d.utility.Vector3dVector(points)
        return made

    target = cloud(case.cloud.points)
    target.normals = open3d.utility.Vector3dVector(case.cloud.normals)
    ending = of.ICPConvergenceCriteria(1e-9, 1e-9, ITERATIONS)

    def by(form: Any) -> Register:
        def register(scan: Array, start: Similarity) -> Similarity:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = start.R, start.t
            found = of.registration_icp(cloud(scan), target, GATE, T, form, ending)
            return Similarity(found.transformation[:3, :3].copy(), found.transformation[:3, 3])

        return register

    plane = of.TransformationEstimationPointToPlane
    coarse = by(plane())
    tukey, geman_mcclure = by(plane(of.TukeyLoss(k=SCALE))), by(plane(of.GMLoss(k=SCALE**2)))
    return {
        f"open3d, point to plane, {CLOUD}": coarse,
        f"open3d, point to plane, then Tukey, {CLOUD}": then(coarse, tukey),
        f"open3d, point to plane, then Geman-McClure, {CLOUD}": then(coarse, geman_mcclure),
        f"open3d, point to point, {CLOUD}": by(of.TransformationEstimationPointToPoint()),
    }


def measured(quick: bool) -> dict[str, object]:
    """For each row: median and largest degrees and mm (mean over the scan's points), median CPU."""
    found: dict[str, Any] = {}
    for seed in range(1 if quick else SCANS):
        case = Case(seed)
        for name, register in (ours(case) | theirs(case)).items():
            began = time.process_time()
            motion = register(case.scan, case.start)
            took = time.process_time() - began
            row = found.setdefault(name, {"degrees": [], "mm": [], "seconds": []})
            off = motion(case.seen) - case.truth(case.seen)
            turned = np.linalg.norm(vector_from_matrix(motion.R @ case.truth.R.T))
            row["degrees"].append(float(np.degrees(turned)))
            row["mm"].append(float(1e3 * np.linalg.norm(off, axis=1).mean()))
            row["seconds"].append(took)
    return {
        name: {
            "scans": len(row["mm"]),
            "degrees": [float(np.median(row["degrees"])), max(row["degrees"])],
            "mm": [float(np.median(row["mm"])), max(row["mm"])],
            "within 20 mm": int(np.sum(np.array(row["mm"]) <= 20)),
            "ms": 1e3 * float(np.median(row["seconds"])),
        }
        for name, row in found.items()
    }


def tables(found: dict[str, Any]) -> str:
    """Medians and largest errors, and how many scans ended within 20 mm."""
    rows = []
    for name, row in found.items():
        (turned, most_turned), (off, most_off) = row["degrees"], row["mm"]
        errors = f"{turned:.3f}", f"{most_turned:.3g}", f"{off:.2f}", f"{most_off:.3g}"
        rows.append((name, *errors, row["within 20 mm"], f"{row['ms']:.0f}"))
    scans = next(iter(found.values()))["scans"]
    head = (
        *(f"{scans} scans, {POINTS:,} points each", "rotation, degrees: median", "largest"),
        *("distance, mm: median", "largest", "within 20 mm", "CPU, ms: median"),
    )
    return table(head, rows)
