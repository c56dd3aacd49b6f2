"""One camera sees depth badly, worst of a body that lies flat across its view."""

import casadi as cs
import numpy as np
import pytest

from tests.tiers import few
from workbench import Block, Problem, Residual, Values, diagnose, load_body, residuals
from workbench.geometry.camera import Camera


def seen_by(*angles: float, distance: float = 4.0) -> tuple[Problem, Values]:
    """The joints of a body in cameras around it, the first in front."""
    body = load_body("small")
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    found, values = [], body.start()
    for i, angle in enumerate(angles):
        camera = Camera(f"camera {i}/")
        observed = Block(f"camera {i}/observed", (24, 2), "px")
        confidence = Block(f"camera {i}/confidence", (24,))
        found.append(
            residuals.keypoints(joints, camera, observed.symbol, confidence.symbol, sigma=1.0)
        )
        c, s = np.cos(angle), np.sin(angle)
        values |= {observed.name: np.zeros((24, 2)), confidence.name: np.ones(24)} | camera.values(
            K=[[1000, 0, 500], [0, 1000, 500], [0, 0, 1]],
            R=np.diag([1.0, -1, -1]) @ [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            t=[0, 0, distance],
        )
    return Problem(found, ("pose", "trans")), values


def nearly_degenerate(problem: Problem, values: Values) -> list[str]:
    return [f.text for f in diagnose(problem, values).findings if "nearly degenerate" in f.text]


@pytest.mark.parametrize("distance", few([5.0, 3.0, 10.0], 1))
def test_a_t_pose_before_one_camera_is_nearly_degenerate(distance: float) -> None:
    problem, values = seen_by(0.0, distance=distance)
    found = diagnose(problem, values)
    assert found.rank == 43  # the rank alone does not tell
    (text,) = nearly_degenerate(problem, values)
    assert text.startswith("nearly degenerate in depth: 14 of 14 joints (pelvis, left_hip, ")
    shares = {turn.joint: turn.second / turn.best for turn in found.joint_turns}
    assert shares["left_shoulder"] < 0.3 < shares["left_ankle"]  # the foot points to the camera


@pytest.mark.parametrize("seed", few(range(4), 1))
def test_other_poses_are_not_degenerate_in_depth(seed: int) -> None:
    problem, values = seen_by(0.0)
    rng = np.random.default_rng(seed)
    found = nearly_degenerate(problem, values | {"pose": rng.normal(0, 0.5, size=(24, 3))})
    assert not any("in depth" in text for text in found)


def test_a_second_camera_sees_depth() -> None:
    assert nearly_degenerate(*seen_by(0.0, 1.2)) == []


def test_points_in_space_are_not_degenerate() -> None:
    body = load_body("small")
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    observed = Block("observed", (24, 3), "m")
    problem = Problem((residuals.landmarks(joints, observed.symbol, sigma=0.01),), ("pose",))
    assert nearly_degenerate(problem, body.start() | {"observed": np.zeros((24, 3))}) == []


def test_a_point_where_the_weakest_direction_nearly_vanishes_is_told() -> None:
    """r = (x, y^2) near y = 0: the rank is two, and hardly."""
    x = Block("x", (2,))
    r = Residual("r", cs.vertcat(x.symbol[0], x.symbol[1] ** 2), 0.01)
    problem = Problem((r,), ("x",), blocks=(x,))
    (text,) = nearly_degenerate(problem, {"x": np.array([1.0, 1e-6])})
    assert "times smaller here than a tenth of a yardstick away; its direction is 1.00 x[1]" in text
    assert nearly_degenerate(problem, {"x": np.array([1.0, 1.0])}) == []
    assert diagnose(problem, {"x": np.array([1.0, 0.0])}).rank == 1
