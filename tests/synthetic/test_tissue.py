"""Simulated tissue: it rests, it sags, it swings as a spring does, and it says what it needs."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.body_mass import body_mass_index
from workbench.errors import BadArgument
from workbench.motions import Motion, splined
from workbench.synthetic import TissueLaw, simulate_tissue
from workbench.synthetic.motions_made_up import made_up_motion
from workbench.synthetic.tissue import softness

SMALL = wb.load_body("small")
LINEAR = TissueLaw(coupling=0.0, stiffening=1e3, range=(4.0, 8.0), damping=0.5)


def still(frames: int, **changed: np.ndarray) -> Motion:
    pose = np.zeros((frames, SMALL.n_joints, 3))
    motion = Motion(pose, np.zeros((frames, 3)), 60.0, SMALL.joint_names)
    return replace(motion, **changed)


def test_tissue_of_a_body_that_stands_does_not_move() -> None:
    assert not simulate_tissue(SMALL, still(5)).any()


def test_a_push_displaces_it_by_the_acceleration_over_the_squared_frequency() -> None:
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


def test_lying_down_it_sags() -> None:
    """On the back, gravity pulls along -z of the body, and no longer along -y."""
    pose = np.zeros((120, SMALL.n_joints, 3))
    pose[:, 0, 0] = -np.pi / 2
    moved = simulate_tissue(SMALL, still(120, pose=pose), LINEAR)[-1]
    f = softness(SMALL, law=LINEAR)
    at = int(np.argmin(f))
    sag = 9.81 / (2 * np.pi * f[at]) ** 2
    np.testing.assert_allclose(moved[at], [0, sag, -sag], rtol=0.02, atol=1e-4)


def test_heavier_people_are_softer() -> None:
    people = [np.array([0.0, 0.0, third]) for third in (-2.0, 2.0)]
    index = [body_mass_index(SMALL, betas) for betas in people]
    f = [softness(SMALL, betas) for betas in people]
    both = np.isfinite(f[0]) & np.isfinite(f[1])
    lighter = int(index[0] > index[1])
    assert abs(index[0] - index[1]) > 3
    assert np.mean(f[lighter][both]) > np.mean(f[1 - lighter][both])


def test_what_cannot_be_simulated_is_said() -> None:
    with pytest.raises(BadArgument, match=r"too few for springs of .* spline the motion"):
        simulate_tissue(SMALL, made_up_motion(SMALL, 1.0, fps=10.0))
    with pytest.raises(BadArgument, match="three frames or more, and this motion has 2"):
        simulate_tissue(SMALL, still(2))
    strange = replace(SMALL, joint_names=tuple(map(str, range(24))))
    with pytest.raises(BadArgument, match="is soft; its joints have other names"):
        simulate_tissue(strange, replace(still(9), joint_names=strange.joint_names))


def test_splined_motions_pass_through_their_frames_with_continuous_accelerations() -> None:
    slow = made_up_motion(SMALL, 2.0, fps=10.0)
    fine = splined(slow, 60.0)
    kept = fine[::6]
    R, S = (wb.Motion.joints(m, SMALL) for m in (slow, kept))
    np.testing.assert_allclose(R[: len(S)], S, atol=1e-12)
    true = made_up_motion(SMALL, 2.0)[: len(fine)]
    inner = slice(12, -12)
    way = (fine.joints(SMALL) - true.joints(SMALL))[inner]
    straight = (slow.resampled(60.0).joints(SMALL) - true.joints(SMALL))[inner]
    assert np.abs(way).max() < 0.3 * np.abs(straight).max()
    with pytest.raises(BadArgument, match="a spline needs 4 frames or more"):
        splined(slow[:3], 60.0)
