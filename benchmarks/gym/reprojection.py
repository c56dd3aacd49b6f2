"""Bundle adjustment of a few cameras and points, all synthetic.

The first camera stands at the origin and the second one's place is known, so that neither a common
motion nor the scale is free. Unknown are the other turns and places, and all points.
"""

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case, posed
from workbench.arrays import Array
from workbench.blocks import Block
from workbench.fitting.setup import Setup
from workbench.geometry.rotation import matrix_from_vector, rodrigues
from workbench.problem import Problem
from workbench.residuals import Residual

POINTS = 8
CAMERAS = 3
NOISE = 1e-3  # of the focal length
SEEDS = range(4)
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
    for seed in SEEDS
)
