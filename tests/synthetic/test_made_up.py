"""Simulated people and tissue: who they are, how their tissue swings, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.geometry.solids import mesh_edges
from workbench.motions import Motion, splined
from workbench.synthetic import TissueLaw, people, simulate_tissue
from workbench.synthetic.made_up import made_up_motion
from workbench.synthetic.tissue import softness

SMALL = wb.load_body("small")
POSES = 0.3 * np.random.default_rng(5).standard_normal((40, 24, 3))
LINEAR = TissueLaw(coupling=0.0, stiffening=1e3, range=(4.0, 8.0), damping=0.5)


def test_person_depends_on_seed_and_number_alone() -> None:
    few, many, others = (people(SMALL, POSES, n, seed) for n, seed in ((2, 0), (5, 0), (2, 1)))
    for one, same, other in zip(few, many[:2], others, strict=True):
        np.testing.assert_array_equal(one.vertices, same.vertices)
        assert not np.allclose(one.vertices, other.vertices, atol=1e-3)
    assert not np.allclose(few[0].vertices, few[1].vertices, atol=1e-3)


def test_people_face_any_way() -> None:
    everyone = people(SMALL, POSES[:1], 400, 0)
    pelvis = np.array([one.values["pose"][0] for one in everyone])
    assert (pelvis[:, [0, 2]] == 0).all()  # turned about the vertical alone
    quarters = np.histogram(pelvis[:, 1], np.linspace(-np.pi, np.pi, 5))[0]
    assert quarters.sum() == 400
    assert quarters.min() > 70
    betas = np.array([one.values["betas"] for one in everyone])
    assert betas.std() == pytest.approx(1, abs=0.05)
    some = people(SMALL, POSES, 50, 0, turn=0.2)
    assert max(abs(one.values["pose"][0, 1]) for one in some) <= 0.2


@pytest.mark.thorough
def test_own_shape_is_smooth_and_as_large_as_asked() -> None:
    plain, own = people(SMALL, POSES, 3, 0), people(SMALL, POSES, 3, 0, own_shape=0.005)
    edges = mesh_edges(SMALL.faces)
    for one, other in zip(plain, own, strict=True):
        np.testing.assert_array_equal(one.values["pose"], other.values["pose"])
        np.testing.assert_array_equal(one.values["betas"], other.values["betas"])
        moved = other.template - SMALL.template
        assert np.sqrt(np.mean((moved**2).sum(axis=1))) == pytest.approx(0.005)
        steps = moved[edges[:, 0]] - moved[edges[:, 1]]
        lengths = np.linalg.norm(np.diff(SMALL.template[edges], axis=1)[:, 0], axis=1)
        slope = np.sqrt((steps**2).sum() / (lengths**2).sum())
        assert slope < 1.3 * 0.005 / 0.1  # it varies over a tenth of a metre
        directions = SMALL.shapedirs.reshape(-1, SMALL.n_betas)
        left = moved.ravel() - directions @ np.linalg.lstsq(directions, moved.ravel())[0]
        assert np.linalg.norm(left) > 0.5 * np.linalg.norm(moved)
        off = np.linalg.norm(one.vertices - other.vertices, axis=1)
        assert 0.002 < np.sqrt(np.mean(off**2)) < 0.01


def test_bad_poses_of_people_are_refused() -> None:
    with pytest.raises(BadArgument, match="at least one"):
        people(SMALL, POSES[:0], 1, 0)
    with pytest.raises(BadArgument, match=r"not \(40, 22, 3\)"):
        people(SMALL, POSES[:, :22], 1, 0)
    with pytest.raises(BadArgument, match="from 0 on, not 1, -1 and 0"):
        people(SMALL, POSES, 1, -1)


# Tissue.


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


def test_splined_motions_pass_through_their_frames() -> None:
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
