"""Priors on poses, a Gaussian and a mixture: as learned, and as shipped."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import workbench
from builder.pose_priors import (
    LEAST_STD,
    UNMEASURED_STD,
    learn_pose_gaussian,
    learn_pose_mixture,
    mirrored_pose,
    save_pose_gaussian,
    save_pose_mixture,
)
from builder.recordings import ELBOW_LIMIT, PoseRecording, read_recording
from workbench.errors import BadFile
from workbench.lectures.material.teacher import JOINT_NAMES, MIRRORED_JOINTS
from workbench.priors.poses import (
    GAUSSIAN_FILE,
    MIXTURE_FILE,
    draw_poses,
    read_pose_gaussian,
    read_pose_mixture,
)

SHIPPED = Path(workbench.__file__).parent / "data" / "poses" / GAUSSIAN_FILE


def recording(n: int = 500) -> PoseRecording:
    poses = 0.2 * np.random.default_rng(0).normal(size=(n, 24, 3))
    poses[:, JOINT_NAMES.index("left_hand")] = poses[:, JOINT_NAMES.index("right_hand")] = 0
    return PoseRecording(poses, np.arange(n) // 50, tuple("abcdefghij"), JOINT_NAMES)


def test_shipped_prior_is_a_gaussian_alike_on_both_sides() -> None:
    prior = read_pose_gaussian(SHIPPED)
    assert prior.mean.shape == (69,)
    assert prior.covariance.shape == (69, 69)
    assert np.array_equal(prior.covariance, prior.covariance.T)
    assert np.linalg.eigvalsh(prior.covariance).min() > 0.9 * LEAST_STD**2
    assert prior.joint_names == JOINT_NAMES[1:]
    mean = np.concatenate([np.zeros((1, 3)), prior.mean.reshape(-1, 3)])
    assert np.array_equal(mirrored_pose(mean, MIRRORED_JOINTS)[1:].ravel(), prior.mean)
    index = (3 * (MIRRORED_JOINTS[1:, None] - 1) + np.arange(3)).ravel()
    signs = np.tile([1.0, -1.0, -1.0], 23)
    mirrored = prior.covariance[np.ix_(index, index)] * np.outer(signs, signs)
    assert abs(mirrored - prior.covariance).max() < 1e-7


def test_shipped_prior_bends_knees_backwards_and_elbows_forwards() -> None:
    prior = read_pose_gaussian(SHIPPED)
    mean = dict(zip(prior.joint_names, prior.mean.reshape(-1, 3), strict=True))
    assert mean["left_knee"][0] > 0.3
    assert mean["left_elbow"][1] < -0.3 < 0.3 < mean["right_elbow"][1]
    assert set(prior.unmeasured) == {
        f"{side}_{joint}" for side in ("left", "right") for joint in ("foot", "collar", "hand")
    }


def test_learned_moments_are_those_of_mirrored_frames() -> None:
    mocap = recording()
    prior = learn_pose_gaussian(mocap)
    both = np.concatenate([mocap.poses, mirrored_pose(mocap.poses, MIRRORED_JOINTS)])
    assert prior.mean == pytest.approx(both[:, 1:].mean(axis=0).ravel())
    spread = np.sqrt(np.diag(prior.covariance)).reshape(23, 3)
    assert spread[:-2] == pytest.approx(np.full((21, 3), 0.2), rel=0.15)
    assert spread[-2:] == pytest.approx(np.hypot(UNMEASURED_STD, LEAST_STD))
    assert prior.unmeasured == ("left_hand", "right_hand")


def test_every_fifth_clip_is_held_out() -> None:
    learned_from, held_out = recording().split()
    assert set(learned_from.clip) & set(held_out.clip) == set()
    assert set(held_out.clip) == {4, 9}
    assert learn_pose_gaussian(learned_from).held_out == ("e", "j")


def test_draws_have_the_moments_of_the_prior() -> None:
    prior = read_pose_gaussian(SHIPPED)
    draws = prior.draw(20000, np.random.default_rng(0))
    assert draws.shape == (20000, 24, 3)
    assert not draws[:, 0].any()
    flat = draws[:, 1:].reshape(-1, 69)
    assert abs(flat.mean(axis=0) - prior.mean).max() < 0.03
    assert abs(np.cov(flat.T) - prior.covariance).max() < 0.02


def test_pose_gaussian_round_trips(tmp_path: Path) -> None:
    prior = learn_pose_gaussian(recording())
    save_pose_gaussian(prior, tmp_path / "prior.npz")
    back = read_pose_gaussian(tmp_path / "prior.npz")
    assert back.mean == pytest.approx(prior.mean, abs=1e-7)
    assert back.covariance == pytest.approx(prior.covariance, abs=1e-7)
    assert (back.joint_names, back.n_frames) == (prior.joint_names, 500)
    assert (back.unmeasured, back.held_out) == (prior.unmeasured, prior.held_out)


def test_frames_with_flipped_elbows_are_left_out(tmp_path: Path) -> None:
    poses = np.zeros((4, 24, 3))
    poses[0, JOINT_NAMES.index("left_elbow"), 1] = ELBOW_LIMIT + 0.1
    poses[1, JOINT_NAMES.index("right_elbow"), 1] = -ELBOW_LIMIT - 0.1
    poses[2, JOINT_NAMES.index("left_elbow"), 1] = -1.5
    np.savez(
        tmp_path / "mocap.npz",
        poses=poses.reshape(4, 72),
        ok=np.array([True, True, True, False]),
        clip=np.zeros(4, np.uint8),
        clip_name=np.array(["walk"]),
        joint_names=np.array(JOINT_NAMES),
    )
    mocap = read_recording(tmp_path / "mocap.npz")
    assert np.array_equal(mocap.poses, poses[2:3])


def test_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="there is no file"):
        read_pose_gaussian(tmp_path / "nothing.npz")
    with pytest.raises(BadFile, match="there is no file"):
        read_recording(tmp_path / "nothing.npz")


SHIPPED_MIXTURE = Path(workbench.__file__).parent / "data" / "poses" / MIXTURE_FILE


def two_habits(n: int = 400) -> PoseRecording:
    """Frames about two poses of the spine, and nothing between them."""
    rng = np.random.default_rng(0)
    poses = 0.05 * rng.normal(size=(n, 24, 3))
    poses[:, 3, 0] += np.where(np.arange(n) % 4 == 0, 1.0, -1.0)
    return PoseRecording(poses, np.arange(n) // 40, tuple("abcdefghij"), JOINT_NAMES)


def test_mixture_tells_two_habits_apart() -> None:
    mixture = learn_pose_mixture(two_habits(), components=2)
    np.testing.assert_allclose(np.sort(mixture.shares), [0.25, 0.75], atol=1e-6)
    np.testing.assert_allclose(np.sort(mixture.means[:, 6]), [-1, 1], atol=0.05)
    drawn = mixture.draw(500, np.random.default_rng(0))[:, 3, 0]
    assert (np.abs(np.abs(drawn) - 1) < 0.6).all()
    assert ((drawn > 0).mean()) == pytest.approx(0.25, abs=0.06)


def test_mixture_density_is_that_of_scipy() -> None:
    mixture = learn_pose_mixture(two_habits(), components=2)
    at = two_habits().poses[:5, 1:].reshape(5, -1)
    for c in range(2):
        expected = multivariate_normal(mixture.means[c], mixture.covariances[c]).logpdf(at)
        expected += np.log(mixture.shares[c])
        np.testing.assert_allclose(mixture.log_density(at)[:, c], expected, rtol=1e-9)


def test_shipped_mixture_draws_poses_and_comes_back(tmp_path: Path) -> None:
    shipped = read_pose_mixture(SHIPPED_MIXTURE)
    assert shipped.joint_names == JOINT_NAMES[1:]
    assert len(shipped.shares) == 8
    assert np.linalg.eigvalsh(shipped.covariances).min() > 5e-5
    poses = draw_poses(shipped, 200, np.random.default_rng(0))
    assert poses.shape == (200, 24, 3)
    assert not poses[:, 0].any()
    save_pose_mixture(shipped, tmp_path / "again.npz")
    again = read_pose_mixture(tmp_path / "again.npz")
    np.testing.assert_allclose(again.covariances, shipped.covariances, rtol=1e-6, atol=1e-9)
    (tmp_path / "bad.npz").write_bytes(b"PK")
    with pytest.raises(BadFile, match="no mixture"):
        read_pose_mixture(tmp_path / "bad.npz")
