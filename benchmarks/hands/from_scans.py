"""Hands from simulated scans, alone and with a skeleton; and the hand that an artist modelled."""

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from benchmarks.hands.from_points import MM, NOISE
from benchmarks.hands.strangers import Stranger, noisy, scanned
from workbench.arrays import Array
from workbench.bodies import HAND_POINTS, SkinnedBody
from workbench.fitting import Scan, read_scan
from workbench.fitting.hands import points_of
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import fit_hand, random_surface_points, register

OF_A_RIG = 0.005  # m: an artist's joints are not where ours are
GOOD = 3.0  # mm, mean over the vertices: a fit that is not farther off has succeeded
DRAWN = 8_000  # points on the artist's surface; every second one is held out


def simulated(
    body: SkinnedBody, hands: Sequence[Stranger], views: int, skeleton: bool, free: bool = False
) -> dict[str, Any]:
    """Errors of fits to scans of all hands, against the truth, in mm; and CPU seconds."""
    means, medians, seen, freed, seconds = [], [], [], [], []
    for i, hand in enumerate(hands):
        scan = scanned(body, hand, i, views)
        points = noisy(hand.points, NOISE, (1, i)) if skeleton else None
        begin = time.process_time()
        vertices = fit_hand(body, scan.scan, points).vertices()
        seconds.append(time.process_time() - begin)
        off = MM * np.linalg.norm(vertices - hand.vertices, axis=1)
        means.append(float(off.mean()))
        medians.append(float(np.median(off)))
        seen.append(float(off[scan.seen].mean()))
        if free:
            surface = register(body, scan.scan).vertices
            freed.append(float(MM * np.linalg.norm(surface - hand.vertices, axis=1).mean()))
        print(f"  {views} views, {'with' if skeleton else 'no'} skeleton, {i}: {means[-1]:.2f} mm")
    good = np.array(means) < GOOD
    return {
        "hands": len(hands),
        "good": int(good.sum()),
        "mean": float(np.median(means)),
        "median": float(np.median(medians)),
        "seen": float(np.median(seen)),
        "worst_good": float(np.array(means)[good].max(initial=0.0)),
        "worst": float(np.max(means)),
        "free": float(np.median(freed)) if freed else None,
        "seconds": float(np.mean(seconds)),
    }


def modelled(body: SkinnedBody, file: Path, turns: int = 5) -> dict[str, Any]:
    """The artist's hand, turned at random: half of its points are fitted, half are held out.

    The fits without the skeleton are those of `workbench register SCAN --body hand`.
    """
    whole = read_scan(file).scan
    assert whole.faces is not None  # it is a mesh
    rng = np.random.default_rng(0)
    points, normals = random_surface_points(whole.points, whole.faces, DRAWN, rng)
    fitted = np.arange(DRAWN) % 2 == 0
    joints = skeleton_of(file)
    found: dict[str, list[float]] = {}
    for k in range(turns):
        R = Rotation.random(random_state=k).as_matrix()
        scan = Scan(points[fitted] @ R.T, normals[fitted] @ R.T)
        assert scan.normals is not None
        rows = np.column_stack([scan.points, scan.normals])
        arrays, freed = by_command(rows, "--model-only"), by_command(rows)["vertices"]
        alone = {block.name: arrays[block.name] for block in body.blocks()}
        both = fit_hand(body, scan, joints @ R.T, sigma=OF_A_RIG)
        for name, vertices in (
            ("model", arrays["model"]),
            ("vertices free", freed),
            ("model, with skeleton", both.vertices()),
        ):
            tree = SurfaceTree(vertices, body.faces)
            off = MM * np.abs(tree.closest(points[~fitted] @ R.T).distances)
            found.setdefault(f"{name}: median", []).append(float(np.median(off)))
            found.setdefault(f"{name}: 95 %", []).append(float(np.percentile(off, 95)))
        for name, values in (("model", alone), ("model, with skeleton", both.values)):
            apart = MM * np.linalg.norm(points_of(body, values) - joints @ R.T, axis=1)
            found.setdefault(f"{name}: joints", []).append(float(np.median(apart)))
            length = float(np.linalg.norm(values[body.blocks()[1].name]))
            found.setdefault(f"{name}: betas", []).append(length)
        print(f"  turn {k}: {found['model: median'][-1]:.2f} mm")
    return {"turns": turns, "held_out": int((~fitted).sum()), **found}


def by_command(rows: Array, *further: str) -> dict[str, Array]:
    """What `workbench register` finds for points and normals (M, 6) in a file."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scan.xyz"
        np.savetxt(file, rows, fmt="%.7f")
        options = ["--body", "hand", "--unit", "m", "--up", "y", "--out", folder, *further]
        subprocess.run(
            [sys.executable, "-m", "workbench", "register", str(file), *options],
            check=True,
            capture_output=True,
        )
        with np.load(Path(folder) / "register-scan" / "registration.npz") as arrays:
            return {name: arrays[name] for name in arrays.files}


def skeleton_of(file: Path) -> Array:
    """The points (21, 3) m that the artist's rig has, in the order of `HAND_POINTS`."""
    graph = trimesh.load_scene(file).graph
    ends = {"1": "phalanx-proximal", "2": "phalanx-intermediate", "3": "phalanx-distal"}
    of_thumb = {"1": "metacarpal", "2": "phalanx-proximal", "3": "phalanx-distal"}

    def node(name: str) -> str:
        if name == "wrist":
            return name
        finger, end = (name[:-4], "tip") if name.endswith("_tip") else (name[:-1], name[-1])
        bones = of_thumb if finger == "thumb" else ends
        return f"{finger}{'' if finger == 'thumb' else '-finger'}-{bones.get(end, 'tip')}"

    return np.array([graph.get(node(name))[0][:3, 3] for name in HAND_POINTS])
