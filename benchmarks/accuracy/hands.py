"""The embedded `hand` fitted to points, skeletons and scans, against the truth.

Hands of *the body* have betas from N(0, 1). *Strangers* are people drawn anew from the artists'
shape targets, posed by the teacher with dual quaternions, so that neither their shapes nor their
surfaces are in the model; none of them was in its training. All of these are synthetic. One hand
was modelled by an artist, independently of ours. Settings were chosen on hands of another seed.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from benchmarks.accuracy import HAND, WHEEL, needed, share, taken
from benchmarks.measuring import table
from builder.base_mesh import read_base_mesh
from builder.hands.mesh import PARENTS, read_hand
from builder.hands.sets import HandPoses, HandTeacher, draw_hands
from builder.population import read_shape_targets
from builder.wheel import Wheel
from workbench import diagnose
from workbench.arrays import Array, Mask
from workbench.bodies import HAND_POINTS, SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.forward.posing import Posing
from workbench.fitting import Scan, hand_problem, hand_start, pose_prior, read_scan, shape_prior
from workbench.fitting.hands import points_of
from workbench.geometry.surface_tree import SurfaceTree
from workbench.lectures.material.teacher import joint_positions
from workbench.priors.joint_limits import hand_limits
from workbench.registration import (
    HAND_RECIPE,
    random_surface_points,
    register,
    with_skeleton,
)
from workbench.solvers import TrustRegion
from workbench.synthetic import Holes, Noise, SimulatedScan, scan, scanners

SEED, POINTS, SCANS = 2032, 100, 20  # of all hands, and how many hands
NOISE = 0.002  # m along each axis
PLACE = 0.3  # m along each axis
DISTANCE, DEPTH_NOISE = 0.4, 0.0005  # m, of the scanners and of their depths
GOOD = 3.0  # mm, mean over the vertices: a fit that is not farther off has succeeded
OF_A_RIG = 0.005  # m: an artist's joints are not where ours are
DRAWN = 8_000  # points on the artist's surface; every second one is held out
TIPS = np.array([name.endswith("_tip") for name in HAND_POINTS])
MM = 1e3


@dataclass(frozen=True, eq=False)
class Hand:
    """One synthetic hand.

    Attributes:
        vertices: (778, 3) m, the true surface.
        points: (21, 3) m, the true joints and finger tips, in the order of `HAND_POINTS`.
    """

    vertices: Array
    points: Array


def of_the_body(body: SkinnedBody, count: int) -> list[Hand]:
    """Hands of the body itself, with angles drawn as those of training were."""
    rng = np.random.default_rng(SEED)
    poses = HandPoses(body.joints(), body.landmark("tips")).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    names, found = [block.name for block in body.blocks()], []
    for pose in poses:
        at = pose, rng.standard_normal(body.n_betas), PLACE * rng.standard_normal(3)
        points = points_of(body, dict(zip(names, at, strict=True)))
        found.append(Hand(body.vertices(*at), points))
    return found


def strangers(wheel: Wheel, body: SkinnedBody, count: int) -> list[Hand]:
    """Hands of people drawn anew, posed by the teacher."""
    mesh = read_base_mesh(wheel)
    own, targets = read_hand(wheel, mesh), read_shape_targets(wheel, len(mesh.vertices))
    people = draw_hands(mesh, own, targets, count, SEED, lambda text: None)
    rng = np.random.default_rng((SEED, 1))
    poses = HandPoses(people.joints.mean(axis=0), people.ends.mean(axis=0)).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    tips = body.landmarks["tips"]
    names = [*body.joint_names, *tips.names]
    order, found = [names.index(name) for name in HAND_POINTS], []
    for rest, joints, pose in zip(people.vertices, people.joints, poses, strict=True):
        shift = PLACE * rng.standard_normal(3)
        posed = HandTeacher(rest, joints, csr_array(own.weights)).vertices(pose) + shift
        at = joint_positions(Posing.of(pose[None], PARENTS).world[0], joints, PARENTS) + shift
        found.append(Hand(posed, np.concatenate([at, tips.regressor @ posed])[order]))
    return found


def noisy(points: Array, seed: tuple[int, int]) -> Array:
    """Points with errors of 2 mm along each axis."""
    return np.asarray(points + NOISE * np.random.default_rng(seed).standard_normal(points.shape))


def ranks(body: SkinnedBody, hand: Hand) -> dict[str, Any]:
    """What 16 joints and 21 points determine of the pose, without priors."""
    problem, found = hand_problem(body, priors=()).freeing("pose"), {}
    for name, hidden in (("16 joints", TIPS), ("21 points", np.zeros_like(TIPS))):
        seen = np.where(hidden[:, None], np.nan, hand.points)
        found[name] = {"rank": diagnose(problem, hand_start(body, seen)).rank, "of": 48}
    return found


def behind_the_wrist(body: SkinnedBody) -> Mask:
    """Which vertices (N,) are behind the wrist joint, or less than 2 cm in front of it."""
    along = body.joints()[body.joint_names.index("middle1")] - body.joints()[0]
    ahead = (body.template - body.joints()[0]) @ along / np.linalg.norm(along)
    return np.asarray(ahead < 0.02)


def to_points(body: SkinnedBody, hands: Sequence[Hand], tips: bool) -> dict[str, Any]:
    """Errors in mm of fits to noisy points of all hands, and their CPU seconds."""
    priors = [pose_prior(body), shape_prior(body), hand_limits().residual(body)]
    problem, solver = hand_problem(body, sigma=NOISE, priors=priors), TrustRegion()
    off, seconds = [], []
    for i, hand in enumerate(hands):
        seen = noisy(hand.points, (0, i))
        if not tips:
            seen[TIPS] = np.nan
        begin = time.process_time()
        values = solver.solve(problem, hand_start(body, seen)).values
        seconds.append(time.process_time() - begin)
        vertices = body.vertices(*(values[block.name] for block in body.blocks()))
        off.append(MM * np.linalg.norm(vertices - hand.vertices, axis=1))
    every = np.array(off)
    return {
        "hands": len(hands),
        "median": float(np.median(every)),
        "worst mean": float(every.mean(axis=1).max()),
        "worst vertex": float(every.max()),
        "worst before the wrist": float(every[:, ~behind_the_wrist(body)].max()),
        "seconds": float(np.median(seconds)),
    }


def scanned(body: SkinnedBody, hand: Hand, seed: int, views: int) -> SimulatedScan:
    """A scan by depth cameras that stand around a hand at 40 cm, with 0.5 mm of noise and holes."""
    return scan(
        hand.vertices,
        body.faces,
        scanners(views, distance=DISTANCE, target=hand.vertices.mean(axis=0)),
        seed=seed,
        noise=Noise(growth=0.0, floor=DEPTH_NOISE, grazing=0.0),
        holes=Holes(2, 0.01),
    )


def to_scans(body: SkinnedBody, hands: Sequence[Hand], views: int, points: bool) -> dict[str, Any]:
    """Mean errors in mm of fits to scans of all hands, and with free vertices; CPU seconds."""
    off, seen, freed, seconds = [], [], [], []
    for i, hand in enumerate(hands):
        simulated = scanned(body, hand, i, views)
        begin = time.process_time()
        recipe = HAND_RECIPE
        if points:
            recipe = with_skeleton(recipe, body, noisy(hand.points, (1, i)))
        fit = recipe.fit(body, simulated.scan)
        seconds.append(time.process_time() - begin)
        each = MM * np.linalg.norm(fit.vertices() - hand.vertices, axis=1)
        off.append(float(each.mean()))
        seen.append(float(each[simulated.seen].mean()))
        if not points:
            surface = register(body, simulated.scan).vertices
            freed.append(float(MM * np.linalg.norm(surface - hand.vertices, axis=1).mean()))
    return {
        "hands": len(hands),
        "good": int(np.sum(np.array(off) < GOOD)),
        "mean": float(np.median(off)),
        "seen": float(np.median(seen)),
        "free": float(np.median(freed)) if freed else None,
        "worst": max(off),
        "seconds": float(np.median(seconds)),
    }


def modelled(body: SkinnedBody, file: Path) -> dict[str, Any]:
    """The artist's hand, turned at random: half of its points are fitted, half are held out. Median
    distances in mm of these, and of joints.
    """
    whole = read_scan(file).scan
    assert whole.faces is not None  # it is a mesh
    rng = np.random.default_rng(0)
    points, normals = random_surface_points(whole.points, whole.faces, DRAWN, rng)
    R = Rotation.random(random_state=0).as_matrix()
    points, normals, joints = points @ R.T, normals @ R.T, skeleton_of(file) @ R.T
    half = Scan(points[::2], normals[::2])
    alone = HAND_RECIPE.fit(body, half)
    both = with_skeleton(HAND_RECIPE, body, joints, sigma=OF_A_RIG).fit(body, half)
    found = {}
    for name, vertices, values in (
        ("model", alone.vertices(), alone.values),
        ("vertices free", register(body, half).vertices, None),
        ("model, with skeleton", both.vertices(), both.values),
    ):
        off = MM * np.abs(SurfaceTree(vertices, body.faces).closest(points[1::2]).distances)
        found[name] = {"median": float(np.median(off)), "95 %": float(np.percentile(off, 95))}
        if values is not None:
            apart = MM * np.linalg.norm(points_of(body, values) - joints, axis=1)
            found[name]["joints"] = float(np.median(apart))
    return found


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


def measured(quick: bool) -> dict[str, object]:
    """Ranks, points, scans and the artist's hand."""
    body, points, scans = load_skinned("hand"), 2 if quick else POINTS, 1 if quick else SCANS
    hands, there = {"the body's": of_the_body(body, points)}, taken(quick, HAND, WHEEL)
    if WHEEL in there:
        hands["strangers'"] = strangers(Wheel(needed(WHEEL)), body, points)
    found: dict[str, Any] = {"ranks": ranks(body, hands["the body's"][0])}
    found["points"] = {
        f"{what}, {whose}": to_points(body, some, tips)
        for whose, some in hands.items()
        for what, tips in (("21 points", True), ("16 joints", False))
    }
    some = list(hands.values())[-1][:scans]
    found["scans"] = {
        "6 views": to_scans(body, some, 6, points=False),
        "1 view": to_scans(body, some, 1, points=False),
        "1 view and 21 points": to_scans(body, some, 1, points=True),
    }
    if HAND in there:
        found["modelled"] = modelled(body, needed(HAND))
    return found


def tables(found: dict[str, Any]) -> str:
    """All four."""
    of_pose = " and ".join(f"{r['rank']} ({what})" for what, r in found["ranks"].items())
    text = f"Of the 48 numbers of a pose, these are determined without priors: {of_pose}.\n\n"
    head: tuple[str, ...]
    keys: tuple[str, ...] = ("median", "worst mean", "worst vertex", "worst before the wrist")
    rows: list[tuple[object, ...]] = [
        (f"{name} ({one['hands']})", *(f"{one[k]:.1f}" for k in keys), f"{one['seconds']:.3f}")
        for name, one in found["points"].items()
    ]
    head = ("seen with 2 mm of noise, mm", "median", "worst hand, its mean", *keys[2:], "CPU s")
    text += table(head, rows)
    rows = []
    for name, one in found["scans"].items():
        good = share(one["good"], one["hands"])
        errors = (one[key] for key in ("mean", "seen", "free", "worst", "seconds"))
        rows.append((name, good, *("" if x is None else f"{x:.2f}" for x in errors)))
    head = (
        *("simulated scans, mm", f"mean below {GOOD:g} mm", "mean", "mean where seen"),
        *("mean, vertices free", "worst mean", "CPU s"),
    )
    text += f"\n{table(head, rows)}"
    if "modelled" in found:
        keys = "median", "95 %", "joints"
        rows = [
            (name, *(f"{one[key]:.2f}" if key in one else "" for key in keys))
            for name, one in found["modelled"].items()
        ]
        head = ("the artist's hand, held-out points, mm", "median", "95 %", "joints, median")
        text += f"\n{table(head, rows)}"
    return text
