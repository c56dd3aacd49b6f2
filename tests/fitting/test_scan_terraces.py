"""Normals of a cloud that a depth camera rounded: terraces, as those of a Kinect are."""

import numpy as np
import pytest

from workbench import SkinnedBody, load_body
from workbench.arrays import Array
from workbench.fitting.scans.surface import (
    NEIGHBOURS,
    least_spread,
    neighbourhoods,
    normals_of_neighbours,
    towards,
)
from workbench.registration import arms_lowered
from workbench.synthetic import Clothing, Scanner, SimulatedScan, clothed, scan, scanners

STEP = 2.85e-3  # 1/m, of a Kinect: depths z are multiples of about this times z^2


def from_behind(body: SkinnedBody, clothing: float = 0.0, seed: int = 0) -> SimulatedScan:
    """A person who stands, one foot ahead, with the back to a depth camera 2.3 m away."""
    pose = arms_lowered(body, 1.2)
    pose[0] = [0.0, np.pi, 0.0]
    for joint, turn in {"left_hip": -0.35, "right_hip": 0.25, "right_knee": 0.3}.items():
        pose[body.joint_names.index(joint)] += [turn, 0.0, 0.0]
    vertices = body.vertices(pose)
    vertices[:, 1] -= vertices[:, 1].min()
    return scan(
        vertices,
        body.faces,
        scanners(1, distance=2.3, height=0.3, target=(0.0, 1.0, 0.0), focal=525.0, size=(480, 640)),
        seed=seed,
        clothing=Clothing(clothing, where=clothed(body)),
    )


def rounded(points: Array, camera: Scanner) -> Array:
    """The points (N, 3) m, their depths moved to the nearest terrace of the camera."""
    depth = camera.seen(points)[:, 2]
    terrace = 1 / (STEP * np.round(1 / (STEP * depth)))
    return np.asarray(camera.place + (points - camera.place) * (terrace / depth)[:, None])


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_normals_ignore_terraces_of_depth_cameras(seed: int) -> None:
    body = load_body("small")
    simulated = from_behind(body, 0.02, seed)
    (camera,) = simulated.scanners
    points = rounded(simulated.scan.points, camera)
    a, b, c = simulated.surface[simulated.faces[simulated.face]].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    narrow = np.concatenate([least_spread(near) for _, near in neighbourhoods(points, NEIGHBOURS)])
    off = {
        name: np.degrees(
            np.arccos((towards(found, points, camera.place) * normals).sum(axis=1).clip(-1, 1))
        )
        for name, found in {"narrow": narrow, "wide": normals_of_neighbours(points)}.items()
    }
    assert np.mean(off["wide"]) < 0.5 * np.mean(off["narrow"])
    assert np.mean(off["wide"] > 45) < 0.2 * np.mean(off["narrow"] > 45)
    assert np.mean(off["wide"] > 60) < 0.5 * np.mean(off["narrow"] > 60)
