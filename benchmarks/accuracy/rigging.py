"""Skeletons found in meshes in motion, beside py-dem-bones.

The embedded body `small` is driven by recorded motion, its blend shapes off. In `recorded` it takes
the recorded poses, in which feet, collars and hands do not move, and elbows and wrists hardly about
more than one axis. In `moved` every joint is turned by made-up angles as well, of 0.15 rad
(standard deviation) about each axis, so that each of them can be found. In `placed` the body is
also put at places of 1 m (standard deviation along each axis) and turned by any angle. A
`character` is like those of games: 6,000 vertices on 18 bones (the body `default` subdivided, its
hands, feet and collars merged with their parents), moved as in `moved`, 24 meshes in single
precision. Bones, weights, joints and tree are compared with those of the body, and the error is
measured on poses of clips that nothing was learned from. py-dem-bones is given the number of bones
that `rig` found; it begins from clusters that it makes itself, of which it may make fewer, and from
as many patches of the mesh at rest: of vertices nearest to points that are as far from each other
as can be.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array, hstack
from scipy.spatial.transform import Rotation
from trimesh.remesh import subdivide

from benchmarks.accuracy import RECORDING, needed
from benchmarks.measuring import table
from builder.recordings import read_recording
from workbench import SkinnedBody, load_body
from workbench.arrays import Array
from workbench.training.rigging.rig import pose_rms, rig

PACKAGES = ("py-dem-bones",)
ADDED = {"moved": 0.15, "recorded": 0.0, "placed": 0.15, "character": 0.15}  # rad
MERGED = ("hand", "foot", "collar")  # into their parents, of a character
VERTICES = 6000  # of a character, about
FAR = 1.0  # m, of the places in `placed`
FRAMES, FEW, HELD_OUT = 120, 24, 20
ROWS = (
    ("moved", 21),
    ("moved", 22),
    ("moved", 23),
    ("moved", 24),
    ("placed", 21),
    ("recorded", 21),
    ("character", 21),
    ("character", 22),
    ("character", 23),
)  # the settings of `rig` were chosen on other seeds
QUICK = (("recorded", 21),)


@dataclass(frozen=True, eq=False)
class Driven:
    """A body and meshes (T, N, 3) m that it made, to learn from and held out."""

    body: SkinnedBody
    meshes: Array
    held_out: Array


def without_blend_shapes(body: SkinnedBody) -> SkinnedBody:
    return replace(
        body,
        posedirs=np.zeros_like(body.posedirs),
        shapedirs=body.shapedirs[:, :, :0],
        capsules=None,
    )


def character() -> SkinnedBody:
    """The body `default` with about `VERTICES` vertices and 18 joints."""
    body = without_blend_shapes(load_body("default"))
    kept = [not name.endswith(MERGED) for name in body.joint_names]
    to = np.where(kept, np.arange(body.n_joints), body.parents)
    new = np.cumsum(kept) - 1
    weights = np.zeros((body.n_vertices, sum(kept)))
    for k, into in enumerate(to):
        weights[:, new[into]] += body.weights[:, k]
    mesh, attributes = (body.template, body.faces), {"weights": weights}
    for some in (None, np.arange((VERTICES - 4 * body.n_vertices) // 2)):
        *mesh, attributes = subdivide(*mesh, some, vertex_attributes=attributes)  # type: ignore[no-untyped-call]
    template, faces = mesh
    more = len(template) - body.n_vertices
    return replace(
        body,
        template=template,
        faces=faces,
        weights=attributes["weights"],
        shapedirs=np.zeros((len(template), 3, 0)),
        posedirs=np.zeros((len(template), 3, 9 * (sum(kept) - 1))),
        J_regressor=hstack([body.J_regressor[kept], csr_array((sum(kept), more))], "csr"),
        parents=tuple(new[to[body.parents[k]]] if k else -1 for k in np.flatnonzero(kept)),
        joint_names=tuple(np.array(body.joint_names)[kept].tolist()),
        mirror=None,
        landmarks={},
        bound_in=None,
    )


def driven(recording: Path, kind: str, frames: int, seed: int) -> Driven:
    """A body without blend shapes, in poses of a recording with angles added."""
    whole = load_body("default")
    of_character = kind == "character"
    body = character() if of_character else without_blend_shapes(load_body("small"))
    used = [name in body.joint_names for name in whole.joint_names]
    learned, others = read_recording(recording).split()
    rng = np.random.default_rng(seed)
    meshes = []
    for source, count in ((learned, frames), (others, HELD_OUT)):
        rows = np.sort(rng.choice(len(source.poses), count, replace=False))
        poses = source.poses[rows][:, used] + ADDED[kind] * rng.standard_normal(
            (count, body.n_joints, 3)
        )
        trans = np.zeros((count, 3))
        if kind == "placed":
            trans = FAR * rng.standard_normal((count, 3))
            poses[:, 0] = Rotation.random(count, rng).as_rotvec()
        meshes.append(
            np.stack([body.vertices(p, trans=t) for p, t in zip(poses, trans, strict=True)])
        )
    if of_character:
        meshes = [each.astype(np.float32).astype(float) for each in meshes]
    return Driven(body, *meshes)


def agreement(found: SkinnedBody, truth: SkinnedBody) -> dict[str, Any]:
    """Bones matched by their weights; edges and joints by the bones that they join."""
    gaps = np.abs(found.weights[:, :, None] - truth.weights[:, None]).max(axis=0)
    own, other = linear_sum_assignment(gaps)
    true = dict(zip(own.tolist(), other.tolist(), strict=True))
    away = []
    for k, place in enumerate(found.joints()):
        a, b = true.get(k), true.get(found.parents[k])
        for child, parent in ((a, b), (b, a)):
            if k and child is not None and truth.parents[child] == parent:
                away.append(float(np.linalg.norm(place - truth.joints()[child])))
    return {
        "bones": found.n_joints,
        "edges": len(away),
        "of_edges": truth.n_joints - 1,
        "largest_weight_error": float(gaps[own, other].max()),
        "largest_joint_error_m": max(away, default=float("nan")),
    }


def theirs(driven: Driven, bones: int) -> list[dict[str, Any]]:
    """py-dem-bones from both beginnings: its number of bones, its error in m, and CPU seconds; none
    if it is not installed.
    """
    try:
        import py_dem_bones
    except ImportError:
        return []
    rest, meshes = driven.body.template, driven.meshes
    seeds, away = [0], np.linalg.norm(rest - rest[0], axis=1)
    while len(seeds) < bones:
        seeds.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(rest - rest[seeds[-1]], axis=1))
    nearest = np.linalg.norm(rest[:, None] - rest[seeds], axis=2).argmin(axis=1)
    found = []
    for begun in ("clusters of its own", "patches"):
        peer = py_dem_bones.DemBones()
        peer.nIters, peer.nInitIters, peer.nTransIters, peer.nWeightsIters = 100, 10, 5, 3
        peer.nnz, peer.weightsSmooth = 4, 0.0  # 1e-4, which it takes by itself, leaves more
        peer.nV, peer.nB, peer.nF, peer.nS = len(rest), bones, len(meshes), 1
        peer.fStart = np.array([0, len(meshes)], np.int32)
        peer.subjectID = np.zeros(len(meshes), np.int32)
        peer.u = np.asfortranarray(rest.T)
        peer.v = np.asfortranarray(meshes.transpose(0, 2, 1).reshape(3 * len(meshes), -1))
        peer.fv = driven.body.faces.tolist()
        if begun == "patches":
            peer.set_weights(np.eye(bones)[:, nearest])
        peer.init()
        began = time.process_time()
        peer.compute()
        found.append(
            {
                "begun": begun,
                "bones": peer.nB,
                "rms_m": peer.rmse(),
                "cpu_s": time.process_time() - began,
            }
        )
    return found


def measured(quick: bool) -> dict[str, object]:
    """Every row by `rig` and by py-dem-bones; `quick` is the recorded one of 24 frames."""
    found: dict[str, Any] = {}
    for kind, seed in QUICK if quick else ROWS:
        few = quick or kind == "character"
        data = driven(needed(RECORDING), kind, FEW if few else FRAMES, seed)
        began = time.process_time()
        rigged = rig(data.meshes, data.body.faces, rest=data.body.template)
        ours = agreement(rigged.body, data.body) | {
            "held_out_rms_m": pose_rms(rigged.body, data.held_out),
            "cpu_s": time.process_time() - began,
        }
        peer = theirs(data, rigged.body.n_joints)
        found[f"{kind} {seed}"] = {"rms_m": rigged.rms, "ours": ours, "py-dem-bones": peer}
        print(f"{kind} {seed}", found[f"{kind} {seed}"], flush=True)
    return found


def tables(found: dict[str, Any]) -> str:
    """One row for each body in motion, and one for each run of py-dem-bones."""
    head: tuple[str, ...]
    head = (
        *("motion, seed", "bones", "edges of the tree", "held-out meshes, rms m"),
        *("weights off by at most", "joints off by at most, m", "CPU s"),
    )
    rows = []
    for name, one in found.items():
        ours = one["ours"]
        whole = ours["edges"] == ours["of_edges"]  # else bones are merged, and cannot agree
        off = ours["largest_weight_error"], ours["largest_joint_error_m"]
        rows.append(
            (
                *(name, ours["bones"], f"{ours['edges']} of {ours['of_edges']}"),
                f"{ours['held_out_rms_m']:.0e}",
                *(f"{number:.0e}" if whole else "" for number in off),
                f"{ours['cpu_s']:.0f}",
            )
        )
    text = table(head, rows)
    peers = [
        (
            f"{name}, {run['begun']}",
            run["bones"],
            f"{1e3 * run['rms_m']:.1f}",
            f"{run['cpu_s']:.1f}",
        )
        for name, one in found.items()
        for run in one["py-dem-bones"]
    ]
    if peers:
        head = ("py-dem-bones, its beginning", "bones", "meshes it was given, rms mm", "CPU s")
        text += f"\n{table(head, peers)}"
    return text
