"""The example on people seen by a Kinect: one who is simulated."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from workbench import SkinnedBody, load_body
from workbench.arrays import Array
from workbench.registration import FitStage, arms_lowered
from workbench.synthetic import Scanner, SimulatedScan, scan, scanners

pytestmark = pytest.mark.thorough

EXAMPLE = import_module("examples.26_people_seen_by_a_kinect")
FEW_STAGES = (
    FitStage(200, 0.05, 0.10, 16, 15),
    FitStage(600, 0.02, 0.05, 4, 20),
    FitStage(1500, 0.008, 0.03, 1, 30),
)
STEP = 2.85e-3  # 1/m, of a Kinect: depths z are multiples of about this times z^2


def from_behind(body: SkinnedBody, seed: int = 0) -> SimulatedScan:
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
    )


def rounded(points: Array, camera: Scanner) -> Array:
    """The points (N, 3) m, their depths moved to the nearest terrace of the camera."""
    depth = camera.seen(points)[:, 2]
    terrace = 1 / (STEP * np.round(1 / (STEP * depth)))
    return np.asarray(camera.place + (points - camera.place) * (terrace / depth)[:, None])


def test_a_simulated_person_is_found_from_behind(tmp_path: Path) -> None:
    body = load_body("small")
    simulated = from_behind(body)
    camera = simulated.scanners[0]
    np.savez(
        tmp_path / "people.npz",
        person_a=rounded(simulated.scan.points, camera),
        camera_position=camera.place,
    )
    one = EXAMPLE.person(tmp_path / "people.npz", "person_a", body, FEW_STAGES)
    assert 0.1 < one.held_out.mean() < 0.5
    assert EXAMPLE.facing_away(one) > 0.9
    model = EXAMPLE.away(one, one.fits["distance"].vertices(), body.faces)
    loose = EXAMPLE.away(one, one.fits["loose distance"].vertices(), body.faces)
    free = EXAMPLE.away(one, one.registered.vertices, body.faces)
    assert np.median(np.abs(free)) < np.median(np.abs(model)) < 7
    assert np.mean(loose > 0) > 0.7 > np.mean(model > 0)
    said = EXAMPLE.in_words("person_a", one, body.faces)
    assert f"model {np.median(np.abs(model)):.1f} mm" in said
    EXAMPLE.draw({"person_a": one}, body.faces, tmp_path / "people.png")
    assert (tmp_path / "people.png").stat().st_size > 10_000
