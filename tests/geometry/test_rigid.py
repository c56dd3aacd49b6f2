"""The best motion between two point sets, rigid or with a scale."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from builder.geometry import umeyama
from tests.tiers import few
from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(20, 3))
MOTION = Similarity(matrix_from_vector([0.4, -1.2, 2.0]), np.array([1.0, -2.0, 3.0]))
NOISY = MOTION(POINTS) + 0.1 * RNG.normal(size=POINTS.shape)
WEIGHTS = RNG.uniform(0.1, 3.0, len(POINTS))


def squared_error(motion: Similarity, target: Array, weights: Array) -> float:
    return float(weights @ np.sum((motion(POINTS) - target) ** 2, axis=1))


def angle(R: Array) -> float:
    return float(np.linalg.norm(Rotation.from_matrix(R).as_rotvec()))


@pytest.mark.parametrize("scale", few([1.7, 1e-3], 1))
def test_motion_with_a_scale_is_found_again(scale: float) -> None:
    found = umeyama(POINTS, Similarity(MOTION.R, MOTION.t, scale)(POINTS))
    np.testing.assert_allclose(found.R, MOTION.R, atol=1e-12)
    np.testing.assert_allclose(found.t, MOTION.t, atol=1e-12)
    np.testing.assert_allclose(found.scale, scale, rtol=1e-12)


def test_example_of_umeyama_1991() -> None:
    """Three points in the plane, and the same mirrored (Umeyama 1991, section IV).

    Each stands here twice, 3 above the plane and 3 below, so that the rotation is one of the plane.
    """
    source = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    target = np.array([[0.0, 0.0], [-1.0, 0.0], [0.0, 2.0]])
    height = np.repeat([3.0, -3.0], 3)
    found = procrustes(*(np.column_stack([np.tile(x, (2, 1)), height]) for x in (source, target)))
    np.testing.assert_allclose(
        found.R, [[0.832, 0.555, 0], [-0.555, 0.832, 0], [0, 0, 1]], atol=5e-4
    )


def test_mirrored_points_give_the_best_rotation() -> None:
    """None of 200 rotations drawn at random is better, and none of 200 near the best one."""
    target = MOTION(POINTS * [-1, 1, 1]) + 0.1 * RNG.normal(size=POINTS.shape)
    best = umeyama(POINTS, target)
    least = squared_error(best, target, np.ones(len(POINTS)))
    for R in Rotation.random(200, rng=RNG).as_matrix():
        for turned in (R, best.R @ matrix_from_vector(0.01 * Rotation.from_matrix(R).as_rotvec())):
            moved = POINTS @ turned.T
            centred, q = moved - moved.mean(axis=0), target - target.mean(axis=0)
            scale = max(0.0, np.sum(centred * q) / np.sum(centred**2))
            assert np.sum((scale * centred - q) ** 2) >= least


def test_rotation_is_that_of_scipy() -> None:
    w = WEIGHTS / WEIGHTS.sum()
    theirs, _ = Rotation.align_vectors(NOISY - w @ NOISY, POINTS - w @ POINTS, weights=WEIGHTS)
    np.testing.assert_allclose(procrustes(POINTS, NOISY, WEIGHTS).R, theirs.as_matrix(), atol=1e-13)


def test_similarities_compose_and_invert() -> None:
    first = Similarity(matrix_from_vector([0.5, 0.1, -2.0]), np.array([1.0, 2.0, 3.0]), 0.5)
    then = Similarity(MOTION.R, MOTION.t, 3.0)
    np.testing.assert_allclose(then.after(first)(POINTS), then(first(POINTS)), atol=1e-14)
    np.testing.assert_allclose(first.inverse()(first(POINTS)), POINTS, atol=1e-14)
    with pytest.raises(BadArgument, match="takes all points to one place"):
        Similarity(np.eye(3), np.zeros(3), 0.0).inverse()


@pytest.mark.parametrize("offset", few([0.0, 1e4], 1))
def test_points_on_a_line_turn_by_the_smallest_angle(offset: float) -> None:
    along, onto = np.array([1.0, 2.0, -0.5]), np.array([0.3, -1.0, 0.8])
    t = np.linspace(-1, 2, 7)[:, None]
    source = offset + t * along / np.linalg.norm(along)
    target = t * onto / np.linalg.norm(onto)
    found = procrustes(source, target)
    np.testing.assert_allclose(found(source), target, atol=1e-14 * (1 + 10 * offset))
    between = np.arccos(along @ onto / np.linalg.norm(along) / np.linalg.norm(onto))
    np.testing.assert_allclose(angle(found.R), between, atol=1e-12 * (1 + offset))


@pytest.mark.parametrize("place", few([0.1, 1e5], 1))
def test_points_at_one_place_do_not_turn(place: float) -> None:
    one = np.full((7, 3), place) + [0.1, 0.7, -0.3]
    for source, target in ((one, POINTS[:7]), (POINTS[:7], one), (one, one)):
        found = procrustes(source, target)
        np.testing.assert_array_equal(found.R, np.eye(3))
        np.testing.assert_allclose(
            found(source.mean(axis=0)), target.mean(axis=0), atol=1e-15 * (10 + 10 * place)
        )
    assert procrustes(POINTS[:1], POINTS[1:2]).t == pytest.approx(POINTS[1] - POINTS[0])


def test_points_that_do_not_fit_are_refused() -> None:
    for source, target, weights, said in (
        (POINTS[:, :2], POINTS, None, "must be points"),
        (POINTS[:0], POINTS[:0], None, "at least one"),
        (POINTS, POINTS[:5], None, "one target point for each"),
        (POINTS, POINTS, np.ones(3), "must be 20 numbers"),
        (POINTS, np.where(POINTS > 1, np.nan, POINTS), None, "not finite"),
        (POINTS, POINTS, -np.ones(20), "at least 0"),
        (POINTS, POINTS, np.zeros(20), "one of them above 0"),
    ):
        with pytest.raises(BadArgument, match=said):
            procrustes(source, target, weights)
