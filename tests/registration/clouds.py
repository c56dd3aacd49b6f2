"""Clouds of points on bodies, for the tests that register them."""

import numpy as np

from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.fitting import Scan
from workbench.geometry.solids import area
from workbench.registration import arms_lowered, random_surface_points

TURN, PLACE = 2.0, np.array([0.3, -0.1, 0.2])  # rad about the vertical, m


def standing(body: SkinnedBody, turn: float = TURN) -> Values:
    """Somebody who stands with a bent knee, turned and moved."""
    pose = arms_lowered(body, 0.9)
    pose[0] = [0.0, turn, 0.0]
    pose[body.joint_names.index("left_knee")] = [0.4, 0.0, 0.0]
    return {"pose": pose, "betas": np.zeros(body.n_betas), "trans": PLACE}


def person(body: SkinnedBody, turn: float = TURN) -> Array:
    """The vertices (N, 3) m of this person."""
    return body.vertices(**standing(body, turn))


def cloud(body: Body, vertices: Array, n: int = 800, seed: int = 0, areas: bool = False) -> Scan:
    """Points drawn from the surface by area, with normals and, if so, areas."""
    rng = np.random.default_rng(seed)
    points, normals = random_surface_points(vertices, body.faces, n, rng)
    each = np.full(n, area(vertices, body.faces) / n) if areas else None
    return Scan(points, normals, weights=each)


def from_one_side(scan: Scan, direction: Array) -> Scan:
    """The points whose normals point at least 60 degrees towards a direction (3,)."""
    assert scan.normals is not None
    return scan.some(np.asarray(scan.normals @ direction > 0.5))


def write_scan(path: str, turn: float = TURN, n: int = 800) -> None:
    """Write a cloud of `small`, x y z and normals, as a text file."""
    body = load_body("small")
    scan = cloud(body, person(body, turn), n)
    assert scan.normals is not None
    np.savetxt(path, np.hstack([scan.points, scan.normals]), fmt="%.6f")
