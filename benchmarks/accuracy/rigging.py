"""Rigging of the embedded body `small`, driven by recorded motion, blend shapes off.

    python -m benchmarks.rigging RECORDING [--dem-bones PYTHON] [--only moved] [--seed 3]

RECORDING is a recording as `workbench.priors.recordings` reads it. In `recorded` the body makes the
recorded poses, in which feet, collars and hands do not move at all, and elbows and wrists hardly
about more than one axis. In `moved` every joint is turned by made-up angles as well, of 0.15 rad
(standard deviation) about each axis, so that each of them can be found. In `placed` the body is
also put at places of 1 m (standard deviation along each axis) and turned by any angle. Bones,
weights, joints and tree are compared with those of the body, and the error is measured on poses of
clips that nothing was learned from. PYTHON is a Python in which py-dem-bones is installed: it
decomposes the same meshes into as many bones. It begins from clusters that it makes itself, of
which it may make fewer, and from as many patches of the mesh at rest: of vertices nearest to points
that are as far from each other as can be.
"""

import argparse
import json
import subprocess
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from workbench import SkinnedBody, load_body
from workbench.arrays import Array
from workbench.priors.recordings import read_recording
from workbench.training.rigging.rig import Rigged, pose_rms, rig

RESULTS = Path(__file__).parent / "results" / "rigging.json"
ADDED = {"moved": 0.15, "recorded": 0.0, "placed": 0.15}  # rad
FAR = 1.0  # m, of the places in `placed`
FRAMES, HELD_OUT = 120, 20
SEED = 3
PEER = """
import sys, time, json, numpy as np, py_dem_bones as peer
given = np.load(sys.argv[1]); rest, V, bones = given["rest"], given["meshes"], int(given["bones"])
T, N, _ = V.shape
seeds, away = [0], np.linalg.norm(rest - rest[0], axis=1)
while len(seeds) < bones:
    seeds.append(int(away.argmax()))
    away = np.minimum(away, np.linalg.norm(rest - rest[seeds[-1]], axis=1))
nearest = np.linalg.norm(rest[:, None] - rest[seeds], axis=2).argmin(axis=1)
found = []
for begun in ("clusters of its own", "patches"):
    for smooth in (0.0, 1e-4):
        d = peer.DemBones()
        d.nIters, d.nInitIters, d.nTransIters, d.nWeightsIters = 100, 10, 5, 3
        d.nnz, d.weightsSmooth = 4, smooth
        d.nV, d.nB, d.nF, d.nS = N, bones, T, 1
        d.fStart, d.subjectID = np.array([0, T], np.int32), np.zeros(T, np.int32)
        d.u = np.asfortranarray(rest.T)
        d.v = np.asfortranarray(V.transpose(0, 2, 1).reshape(3 * T, N))
        d.fv = given["faces"].tolist()
        if begun == "patches":
            d.set_weights(np.eye(bones)[:, nearest])
        d.init()
        began = time.process_time()
        d.compute()
        found.append({"begun": begun, "bones": d.nB, "smooth": smooth, "rms_m": d.rmse(),
                      "cpu_s": time.process_time() - began})
print(json.dumps(found))
"""


@dataclass(frozen=True, eq=False)
class Driven:
    """A body and meshes (T, N, 3) m that it made, to learn from and held out."""

    body: SkinnedBody
    meshes: Array
    held_out: Array


def driven(recording: Path, kind: str, frames: int, seed: int) -> Driven:
    """The body `small` without blend shapes, in poses of a recording with angles added."""
    whole = load_body("small")
    assert isinstance(whole, SkinnedBody)
    body = replace(
        whole,
        posedirs=np.zeros_like(whole.posedirs),
        shapedirs=whole.shapedirs[:, :, :0],
        capsules=None,
    )
    learned, others = read_recording(recording).split()
    rng = np.random.default_rng(seed)
    meshes = []
    for source, count in ((learned, frames), (others, HELD_OUT)):
        rows = np.sort(rng.choice(len(source.poses), count, replace=False))
        poses = source.poses[rows] + ADDED[kind] * rng.standard_normal((count, body.n_joints, 3))
        trans = np.zeros((count, 3))
        if kind == "placed":
            trans = FAR * rng.standard_normal((count, 3))
            poses[:, 0] = Rotation.random(count, rng).as_rotvec()
        meshes.append(
            np.stack([body.vertices(p, trans=t) for p, t in zip(poses, trans, strict=True)])
        )
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


def ours(given: Driven) -> tuple[Rigged, dict[str, Any]]:
    """What `rig` finds, and how well."""
    began = time.process_time()
    found = rig(given.meshes, given.body.faces, rest=given.body.template)
    seconds = time.process_time() - began
    return found, agreement(found.body, given.body) | {
        "rms_m": found.rms,
        "held_out_rms_m": pose_rms(found.body, given.held_out),
        "cpu_s": seconds,
        "notes": found.notes,
    }


def theirs(given: Driven, bones: int, python: str) -> Any:
    """What py-dem-bones makes of the same meshes: errors of what it was given."""
    with tempfile.TemporaryDirectory() as folder:
        arrays = Path(folder) / "meshes.npz"
        body = given.body
        np.savez(arrays, rest=body.template, faces=body.faces, meshes=given.meshes, bones=bones)
        ran = subprocess.run(
            [python, "-c", PEER, str(arrays)], capture_output=True, text=True, check=True
        )
    return json.loads(ran.stdout.splitlines()[-1])


def main() -> None:
    """Measure, and add to results/rigging.json, under kind and seed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("recording", type=Path)
    parser.add_argument("--dem-bones", metavar="PYTHON")
    parser.add_argument("--only", choices=ADDED, action="append")
    parser.add_argument("--frames", type=int, default=FRAMES)
    parser.add_argument("--seed", type=int, default=SEED)
    given = parser.parse_args()
    for kind in given.only or ADDED:
        data = driven(given.recording, kind, given.frames, given.seed)
        rigged, found = ours(data)
        name = f"{kind} {given.seed}"
        result = {"frames": given.frames, "held_out_frames": HELD_OUT, "ours": found}
        print(json.dumps({name: result}, indent=1), flush=True)
        if given.dem_bones:
            result["py_dem_bones"] = theirs(data, rigged.body.n_joints, given.dem_bones)
        results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
        RESULTS.write_text(json.dumps(results | {name: result}, indent=1) + "\n")
        print(json.dumps({name: result}, indent=1), flush=True)


if __name__ == "__main__":
    main()
