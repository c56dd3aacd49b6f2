"""Bundle adjustment, arms that reach for a target, and bodies far from their start; all synthetic.

In a bundle the first camera stands at the origin and the second one's place is known, so that
neither a common motion nor the scale is free. Unknown are the other turns and places, and all
points. Of a body every vertex is known, its joints are bent, and the fit begins at the template;
the seeds are others than those that any test of the workbench fits.
"""

import casadi as cs
import numpy as np

from benchmarks.solvers.case import Case, case, one_block, posed
from workbench.arrays import Array
from workbench.blocks import Block
from workbench.experiments.body_fits import body_vertices
from workbench.fitting.setup import Setup
from workbench.geometry.rotation import matrix_from_vector, rodrigues
from workbench.problem import Problem
from workbench.residuals import Residual

# Bundles

POINTS = 8
CAMERAS = 3
NOISE = 1e-3  # of the focal length
DEPTH = 5.0  # of the points


def _image(R: cs.MX, t: cs.MX, points: cs.MX) -> cs.MX:
    seen = R @ points + cs.repmat(t, 1, POINTS)
    return seen[:2, :] / cs.repmat(seen[2, :], 2, 1)


def bundle(seed: int = 0, noise: float = 0.0) -> Setup:
    """All cameras see all points, to `noise` focal lengths; the start is drawn with the seed."""
    rng = np.random.default_rng((10, seed))
    points = rng.uniform(-1.5, 1.5, (POINTS, 3)) + [0, 0, DEPTH]
    turns = 0.3 * rng.standard_normal((CAMERAS - 1, 3))
    places = np.array([[-1.0, 0.2, 0.1], [1.2, -0.3, 0.4]])
    R = [np.eye(3), *matrix_from_vector(turns)]
    t = [np.zeros(3), *places]
    seen = [_pinhole(a, b, points) for a, b in zip(R, t, strict=True)]
    seen = [s + noise * rng.standard_normal(s.shape) for s in seen]
    if noise:
        seen = [np.round(s, 12) for s in seen]
    turn = Block("turn", (CAMERAS - 1, 3), "rad")
    place = Block("place", (3,), "m")
    point = Block("point", (POINTS, 3), "m")
    motions = (
        (cs.MX(cs.DM.eye(3)), cs.MX(cs.DM.zeros(3))),
        (rodrigues(turn.symbol[:, 0]), cs.MX(cs.DM(places[0]))),
        (rodrigues(turn.symbol[:, 1]), place.symbol),
    )
    rows = cs.vertcat(
        *(
            cs.vec(_image(a, b, point.symbol) - cs.DM(s.T))
            for (a, b), s in zip(motions, seen, strict=True)
        )
    )
    truth = {"turn": turns, "place": places[1], "point": points}
    start = {
        "turn": np.zeros((CAMERAS - 1, 3)),
        "place": np.array([1.0, 0.0, 0.0]),
        "point": np.column_stack([DEPTH * seen[0], np.full(POINTS, DEPTH)]),
    }
    names = tuple(truth)
    problem = Problem((Residual("pixels", rows, NOISE),), names, blocks=(turn, place, point))
    source = "the cameras and points of which the images were made"
    if noise:
        return posed(name_of(seed, noise), problem, start, f"next to {source}", made_of=truth)
    return posed(name_of(seed, noise), problem, start, source, truth)


def _pinhole(R: Array, t: Array, points: Array) -> Array:
    seen = points @ R.T + t
    return np.asarray(seen[:, :2] / seen[:, 2:])


def name_of(seed: int, noise: float) -> str:
    """`bundle-noisy-3`."""
    return f"bundle-{'noisy' if noise else 'exact'}-{seed}"


BUNDLES: tuple[Case, ...] = tuple(
    case(name_of(seed, noise), "bundle adjustment", bundle, {"seed": seed, "noise": noise})
    for noise in (0.0, NOISE)
    for seed in range(4)
)


# Arms

COMFORT = 0.5  # rad, the standard deviation of a joint at rest
REACH = 0.01  # of the arm's length


def planar_arm(links: int = 3, seed: int = 0) -> Setup:
    """The tip of an arm of hinges is at a target that it can reach; more angles than equations."""
    rng = np.random.default_rng((11, links, seed))
    lengths = rng.uniform(0.5, 1.5, links) / links
    truth = rng.uniform(-1.5, 1.5, links)
    angle = Block("angle", (links,), "rad")

    def tip(angles: cs.MX) -> cs.MX:
        headings = cs.cumsum(angles)
        along = cs.horzcat(cs.cos(headings), cs.sin(headings))
        return along.T @ cs.DM(lengths)

    target = tip(cs.DM(truth))
    reach = Residual("tip", tip(angle.symbol) - target, REACH)
    start = np.round(0.3 * rng.standard_normal(links), 9)
    source = "the angles by which the target was placed"
    return one_block(f"arm-planar-{links}-{seed}", reach, angle, start, source, truth)


def spatial_arm(seed: int = 0) -> Setup:
    """Three ball joints of an arm: its tip is at a target, its joints are as near rest as can be.

    The target was placed with joints turned by one radian per axis, and the arm begins at rest.
    """
    rng = np.random.default_rng((12, seed))
    truth = np.round(rng.standard_normal((3, 3)), 9)
    bones = np.round(rng.uniform(0.2, 0.4, (3, 3)), 9)
    joint = Block("joint", (3, 3), "rad")

    def tip(joints: cs.MX) -> cs.MX:
        R, place = cs.MX(cs.DM.eye(3)), cs.MX(cs.DM.zeros(3))
        for k in range(3):
            R = R @ rodrigues(joints[:, k])
            place = place + R @ cs.DM(bones[k])
        return place

    placed = cs.Function("tip", [joint.symbol], [tip(joint.symbol)])
    target = np.round(np.asarray(placed(cs.DM(truth.T)), dtype=float).ravel(), 9)
    residuals = (
        Residual("tip", tip(joint.symbol) - cs.DM(target), REACH),
        Residual("comfort", cs.vec(joint.symbol), COMFORT),
    )
    return posed(
        f"arm-spatial-{seed}",
        Problem(residuals, ("joint",), blocks=(joint,)),
        {"joint": np.zeros((3, 3))},
        "the lowest of many descents, from rest and from the truth; no proof",
        made_of={"joint": truth},
    )


ARMS: tuple[Case, ...] = (
    *(
        case(
            f"arm-planar-{links}-{seed}",
            "kinematics",
            planar_arm,
            {"links": links, "seed": seed},
        )
        for links in (3, 6)
        for seed in range(3)
    ),
    *(case(f"arm-spatial-{seed}", "kinematics", spatial_arm, {"seed": seed}) for seed in range(4)),
)


# Bodies

FAR_BODIES: tuple[Case, ...] = tuple(
    case(
        f"body-{sigma:g}-{seed}",
        "bodies",
        body_vertices,
        {"body": "small", "seed": seed, "pose_sigma": sigma},
    )
    for sigma in (0.3, 0.6, 1.0)  # rad per axis
    for seed in range(1000, 1006)
)
