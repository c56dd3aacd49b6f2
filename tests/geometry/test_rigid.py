"""The best rigid motion between two point sets."""

import numpy as np
import pytest

from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(20, 3))
MOTION = Similarity(matrix_from_vector([0.4, -1.2, 2.0]), np.array([1.0, -2.0, 3.0]))


@pytest.mark.parametrize("count", [3, 20])
def test_a_motion_is_found_again(count: int) -> None:
    found = procrustes(POINTS[:count], MOTION(POINTS[:count]))
    np.testing.assert_allclose(found.R, MOTION.R, atol=1e-13)
    np.testing.assert_allclose(found.t, MOTION.t, atol=1e-13)
    assert found.scale == 1.0


def test_mirrored_data_still_give_a_proper_rotation() -> None:
    mirrored = MOTION(POINTS * [-1, 1, 1])
    found = procrustes(POINTS, mirrored)
    np.testing.assert_allclose(found.R.T @ found.R, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(found.R), 1, atol=1e-14)


def test_weights_say_whom_to_believe() -> None:
    target = MOTION(POINTS)
    target[0] += 5.0  # an outlier
    weights = np.ones(len(POINTS))
    weights[0] = 0.0
    np.testing.assert_allclose(procrustes(POINTS, target, weights).R, MOTION.R, atol=1e-13)
    assert np.abs(procrustes(POINTS, target).R - MOTION.R).max() > 1e-2


def test_a_whole_weight_is_a_repeated_point() -> None:
    target = MOTION(POINTS) + 0.1 * RNG.normal(size=POINTS.shape)
    times = RNG.integers(1, 4, len(POINTS))
    weighted = procrustes(POINTS, target, times)
    repeated = procrustes(np.repeat(POINTS, times, axis=0), np.repeat(target, times, axis=0))
    np.testing.assert_allclose(weighted.R, repeated.R, atol=1e-13)
    np.testing.assert_allclose(weighted.t, repeated.t, atol=1e-13)


def test_no_motion_nearby_does_better() -> None:
    target = MOTION(POINTS) + 0.1 * RNG.normal(size=POINTS.shape)
    best = procrustes(POINTS, target)
    least = np.sum((best(POINTS) - target) ** 2)
    for turn, shift in 0.02 * RNG.normal(size=(200, 2, 3)):
        other = Similarity(best.R @ matrix_from_vector(turn), best.t + shift)
        assert np.sum((other(POINTS) - target) ** 2) > least
