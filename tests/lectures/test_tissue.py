"""Simulated tissue: how it swings, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.lectures.material.tissue_simulation import TissueLaw, simulate_tissue, softness
from workbench.motions import Motion
from workbench.synthetic.made_up import made_up_motion

SMALL = wb.load_body("small")
LINEAR = TissueLaw(coupling=0.0, stiffening=1e3, range=(4.0, 8.0), damping=0.5)


def still(frames: int, **changed: np.ndarray) -> Motion:
    pose = np.zeros((frames, SMALL.n_joints, 3))
    motion = Motion(pose, np.zeros((frames, 3)), 60.0, SMALL.joint_names)
    return replace(motion, **changed)


def test_tissue_at_rest_does_not_move() -> None:
    assert not simulate_tissue(SMALL, still(5)).any()


def test_displacement_is_acceleration_over_squared_frequency() -> None:
    """In a car that accelerates, everything stays behind, each vertex as its spring is soft."""
    times = np.arange(90) / 60
    push = np.array([0.0, 0.0, 1.5])
    moved = simulate_tissue(SMALL, still(90, trans=0.5 * times[:, None] ** 2 * push), LINEAR)[-1]
    f = softness(SMALL, law=LINEAR)
    soft = np.isfinite(f)
    assert soft.any()
    assert not moved[~soft].any()
    np.testing.assert_allclose(
        moved[soft], -push / (2 * np.pi * f[soft, None]) ** 2, rtol=2e-3, atol=1e-6
    )


def test_tissue_sags_when_lying_down() -> None:
    """On the back, gravity pulls along -z of the body, and no longer along -y."""
    pose = np.zeros((120, SMALL.n_joints, 3))
    pose[:, 0, 0] = -np.pi / 2
    moved = simulate_tissue(SMALL, still(120, pose=pose), LINEAR)[-1]
    f = softness(SMALL, law=LINEAR)
    at = int(np.argmin(f))
    sag = 9.81 / (2 * np.pi * f[at]) ** 2
    np.testing.assert_allclose(moved[at], [0, sag, -sag], rtol=0.02, atol=1e-4)


def test_bad_motions_of_tissue_are_refused() -> None:
    with pytest.raises(BadArgument, match=r"too few for springs of .* spline the motion"):
        simulate_tissue(SMALL, made_up_motion(SMALL, 1.0, fps=10.0))
    with pytest.raises(BadArgument, match="three frames or more, and this motion has 2"):
        simulate_tissue(SMALL, still(2))
    strange = replace(SMALL, joint_names=tuple(map(str, range(24))))
    with pytest.raises(BadArgument, match="is soft; its joints have other names"):
        simulate_tissue(strange, replace(still(9), joint_names=strange.joint_names))
