"""The mixture of poses: as learned, and as shipped."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import workbench
from builder.pose_mixture import learn_pose_mixture, save_pose_mixture
from workbench.errors import BadFile
from workbench.priors.mocap import Mocap
from workbench.priors.poses import MIXTURE_FILE, draw_poses, read_pose_mixture
from workbench.synthetic.skeleton import JOINT_NAMES

SHIPPED = Path(workbench.__file__).parent / "data" / "poses" / MIXTURE_FILE


def two_habits(n: int = 400) -> Mocap:
    """Frames about two poses of the spine, and nothing between them."""
    rng = np.random.default_rng(0)
    poses = 0.05 * rng.normal(size=(n, 24, 3))
    poses[:, 3, 0] += np.where(np.arange(n) % 4 == 0, 1.0, -1.0)
    return Mocap(poses, np.arange(n) // 40, tuple("abcdefghij"), JOINT_NAMES)


def test_two_habits_are_told_apart() -> None:
    found = learn_pose_mixture(two_habits(), components=2)
    np.testing.assert_allclose(np.sort(found.shares), [0.25, 0.75], atol=1e-6)
    np.testing.assert_allclose(np.sort(found.means[:, 6]), [-1, 1], atol=0.05)
    drawn = found.draw(500, np.random.default_rng(0))[:, 3, 0]
    assert (np.abs(np.abs(drawn) - 1) < 0.6).all()
    assert ((drawn > 0).mean()) == pytest.approx(0.25, abs=0.06)


def test_density_is_that_of_scipy() -> None:
    found = learn_pose_mixture(two_habits(), components=2)
    at = two_habits().poses[:5, 1:].reshape(5, -1)
    for c in range(2):
        expected = multivariate_normal(found.means[c], found.covariances[c]).logpdf(at)
        expected += np.log(found.shares[c])
        np.testing.assert_allclose(found.log_density(at)[:, c], expected, rtol=1e-9)


def test_shipped_mixture_draws_poses_and_comes_back(tmp_path: Path) -> None:
    shipped = read_pose_mixture(SHIPPED)
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
