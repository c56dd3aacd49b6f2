"""The network that reads a pose off keypoints: invariances, files, placing, training."""

import sys
from pathlib import Path

import numpy as np
import pytest

from tests.fitting.test_image_fit import BODY, K, distance, person, seen
from workbench.errors import BadArgument, BadFile, NotSupported
from workbench.fitting import (
    read_regressor,
    regressed_start,
    shipped_regressor,
)
from workbench.fitting.images import image_fit
from workbench.fitting.placing import placed_by_rays
from workbench.geometry.mirror import opposites
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.material.regressor_training import save_regressor, train_pose_regressor
from workbench.priors.poses import shipped_mixture

REGRESSOR = shipped_regressor()
M = len(REGRESSOR.keypoint_names)


def rays(seed: int) -> np.ndarray:
    (shot,) = seen(person(seed)).ordered(REGRESSOR.keypoint_names).photographs
    return (shot.pixels - K[:2, 2]) / K[0, 0]


def test_regressor_is_invariant_to_scale_and_camera() -> None:
    """From a camera that looks 20 degrees aside the pose stays, and the facing turns."""
    x, trust = rays(1), np.ones(M)
    x = x - np.median(x, axis=0)  # in the middle of the image, where nothing turns the camera
    facing, pose = REGRESSOR.regress(x, trust)
    for scale in (0.3, 2.0):
        again, same = REGRESSOR.regress(scale * x, trust)
        np.testing.assert_allclose(same, pose, atol=1e-9)
        np.testing.assert_allclose(again, facing, atol=1e-9)
    turn = matrix_from_vector([0.0, np.radians(20), 0.0])
    aside = np.column_stack([x, np.ones(M)]) @ turn.T
    moved, same = REGRESSOR.regress(aside[:, :2] / aside[:, 2:], trust)
    np.testing.assert_allclose(same, pose, atol=0.02)
    np.testing.assert_allclose(moved, turn @ facing, atol=0.02)


def test_regressor_ignores_confidence_zero() -> None:
    x, trust = rays(2), np.ones(M)
    trust[[3, 8]] = 0.0
    other = x.copy()
    other[[3, 8]] += [[0.4, -0.2], [np.nan, np.nan]]
    for a, b in zip(REGRESSOR.regress(x, trust), REGRESSOR.regress(other, trust), strict=True):
        np.testing.assert_array_equal(a, b)


def test_regressor_is_equivariant_under_mirroring() -> None:
    x, trust = rays(3), np.ones(M)
    swapped = opposites(REGRESSOR.keypoint_names)
    facing, pose = REGRESSOR.regress(x, trust)
    facing_m, pose_m = REGRESSOR.regress(x[swapped] * [-1, 1], trust)
    S = np.diag([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(facing_m, S @ facing @ S, atol=1e-9)
    joints = opposites(REGRESSOR.joint_names)
    np.testing.assert_allclose(pose_m, pose[joints] * [1, -1, -1], atol=1e-9)


def test_bodies_are_placed_exactly_on_their_rays() -> None:
    points = np.random.default_rng(0).normal(size=(M, 3))
    T = np.array([0.3, -0.2, 5.0])
    seen_at = (points + T)[:, :2] / (points + T)[:, 2:]
    found, off = placed_by_rays(points[None], seen_at, np.ones((1, M)))
    np.testing.assert_allclose(found[0], T, atol=1e-9)
    assert off.max() < 1e-9
    wrong = seen_at.copy()
    wrong[[0, 5]] += 1.0
    found, _ = placed_by_rays(points[None], wrong, np.ones((1, M)))
    assert np.linalg.norm(found[0] - T) < 0.1


def test_starts_are_nearer_than_the_resting_body() -> None:
    closer = []
    for truth in map(person, range(6)):
        setup = image_fit(seen(truth, 3.0), BODY, "q")
        start = regressed_start(REGRESSOR, BODY, setup.views[0], setup.start)
        rest = BODY.start()
        rest["pose"][0] = truth["pose"][0]  # even if it faced the right way
        closer.append(distance(start, truth) < distance(rest, truth))
    assert np.mean(closer) >= 0.8


def test_regressor_survives_its_file(tmp_path: Path) -> None:
    save_regressor(REGRESSOR, tmp_path / "r.npz")
    again = read_regressor(tmp_path / "r.npz").regress(rays(1), np.ones(M))
    for a, b in zip(again, REGRESSOR.regress(rays(1), np.ones(M)), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-3)
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(BadFile):
        read_regressor(tmp_path / "bad.npz")


def test_bad_input_is_refused() -> None:
    few, bad = (np.arange(M) < 2).astype(float), rays(1)
    bad[0] = np.nan
    for x, trust, said in [
        (np.zeros((4, 2)), np.ones(4), "takes rays"),
        (rays(1), few, "fewer than 3"),
        (bad, np.ones(M), "finite"),
    ]:
        with pytest.raises(BadArgument, match=said):
            REGRESSOR.regress(x, trust)


@pytest.mark.thorough
def test_small_regressor_is_trained() -> None:
    losses: list[float] = []
    prior = shipped_mixture()
    trained = train_pose_regressor(
        BODY, prior, n=300, passes=8, hidden=(32,), progress=lambda _, loss: losses.append(loss)
    )
    assert len(losses) == 8
    assert losses[-1] < losses[0]
    facing, pose = trained.regress(rays(1), np.ones(M))
    assert pose.shape == (24, 3)
    np.testing.assert_allclose(facing @ facing.T, np.eye(3), atol=1e-9)


def test_without_scikit_learn_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn", None)
    with pytest.raises(NotSupported, match=r"needs scikit-learn.*learn"):
        train_pose_regressor(BODY, shipped_mixture(), n=50, passes=1)
