"""Parts of rigid registration: steps, losses and clouds as targets."""

import doctest

import numpy as np
import pytest
import trimesh

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    Contacts,
    GemanMcClure,
    LeastSquares,
    PointCloud,
    Trimmed,
    distance_gauss_newton,
    icp,
    icp_steps,
    point_to_plane,
    point_to_point,
)
from workbench.registration.icp_steps import Step, part_of

STEPS_RNG = np.random.default_rng(3)
CUBE = trimesh.creation.box((1.0, 1.2, 1.6))
BOX = SurfaceTree(CUBE.vertices, CUBE.faces)
POINTS = STEPS_RNG.normal(size=(60, 3))
WEIGHTS = STEPS_RNG.uniform(0.5, 2.0, 60)
EACH = pytest.mark.parametrize("step", [distance_gauss_newton, point_to_plane, point_to_point])


def contacts(points: Array = POINTS) -> Contacts:
    found = BOX.closest(points)
    return Contacts(points, found.points, found.normals, WEIGHTS)


def cost(x: Array) -> float:
    """Half the weighted squares of distances after the motion (w, v), contacts chosen anew."""
    d = BOX.closest(POINTS @ matrix_from_vector(x[:3]).T + x[3:]).distances
    return float(WEIGHTS @ d**2) / 2


def test_gradient_with_frozen_contacts_is_exact() -> None:
    """At faces, edges and vertices alike, by differences of the cost with contacts chosen anew."""
    found = BOX.closest(POINTS)
    at_faces = np.count_nonzero(found.shares > 1e-12, axis=1)
    assert {1, 2, 3} <= set(at_faces.tolist())
    off = POINTS - found.points
    u = off / np.linalg.norm(off, axis=1, keepdims=True)
    J = np.column_stack([np.cross(POINTS, u), u])
    gradient = J.T @ (WEIGHTS * np.linalg.norm(off, axis=1))
    h = 1e-5
    differences = [(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(gradient, differences, rtol=1e-8, atol=1e-8)


def test_gauss_newton_solves_the_normal_equations_of_the_distance() -> None:
    found = contacts()
    off = POINTS - found.closest
    d = np.linalg.norm(off, axis=1)
    u = off / d[:, None]
    centre = WEIGHTS @ POINTS / WEIGHTS.sum()
    J = np.column_stack([np.cross(POINTS - centre, u), u])
    root = np.sqrt(WEIGHTS)
    x = np.linalg.lstsq(root[:, None] * J, -root * d)[0]
    step = distance_gauss_newton(found)
    np.testing.assert_allclose(step.R, matrix_from_vector(x[:3]), atol=1e-12)
    np.testing.assert_allclose(step(centre), centre + x[3:], atol=1e-12)


def test_step_inside_faces_is_point_to_plane() -> None:
    found = BOX.closest(POINTS)
    inner = np.all(found.shares > 1e-9, axis=1)
    some = Contacts(POINTS[inner], found.points[inner], found.normals[inner], WEIGHTS[inner])
    one, other = distance_gauss_newton(some), point_to_plane(some)
    np.testing.assert_allclose(one.R, other.R, atol=1e-12)
    np.testing.assert_allclose(one.t, other.t, atol=1e-12)
    whole = distance_gauss_newton(contacts()), point_to_plane(contacts())
    assert np.abs(whole[0].t - whole[1].t).max() > 1e-3  # at edges and vertices they differ


def test_point_to_point_is_procrustes() -> None:
    found = contacts()
    expected = procrustes(POINTS, found.closest, WEIGHTS)
    np.testing.assert_array_equal(point_to_point(found).R, expected.R)


@EACH
def test_steps_are_equivariant_under_frames(step: Step) -> None:
    """Where the frame is, points and target moved together, is nothing to the motion."""
    frame = Similarity(matrix_from_vector([0.3, 1.0, -2.0]), np.array([5.0, -3.0, 2.0]))
    one = contacts()
    moved = Contacts(frame(one.points), frame(one.closest), one.normals @ frame.R.T, WEIGHTS)
    expected = frame.after(step(one)).after(frame.inverse())
    np.testing.assert_allclose(step(moved).R, expected.R, atol=1e-10)
    np.testing.assert_allclose(step(moved).t, expected.t, atol=1e-9)
    still = step(Contacts(POINTS, POINTS, one.normals, WEIGHTS))  # in place already
    np.testing.assert_allclose(still.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(still.t, 0, atol=1e-12)


@EACH
def test_steps_of_few_points_are_short(step: Step) -> None:
    """Two distances leave motions open, and the step takes none of these."""
    few = Contacts(*(x[:2] for x in (POINTS, contacts().closest, contacts().normals, WEIGHTS)))
    motion = step(few)
    assert np.isfinite(motion.R).all()
    moved = np.linalg.norm(motion(few.points) - few.points, axis=1).max()
    assert moved <= 3 * np.linalg.norm(few.points - few.closest, axis=1).max()


def test_steps_on_a_plane_do_not_slide() -> None:
    flat = np.column_stack([STEPS_RNG.uniform(-1, 1, (20, 2)), np.full(20, 0.3)])
    down = flat * [1, 1, 0]
    some = Contacts(flat, down, np.tile([0.0, 0.0, 1.0], (20, 1)), np.ones(20))
    for step in (distance_gauss_newton, point_to_plane, point_to_point):
        np.testing.assert_allclose(step(some).t, [0, 0, -0.3], atol=1e-12)
        np.testing.assert_allclose(step(some).R, np.eye(3), atol=1e-12)


def test_point_to_plane_needs_normals() -> None:
    with pytest.raises(BadArgument, match="needs normals of the target, which has none"):
        point_to_plane(Contacts(POINTS, POINTS, 0 * POINTS, WEIGHTS))


def test_half_a_motion_twice_is_the_motion() -> None:
    motion = Similarity(matrix_from_vector([0.2, -0.4, 1.0]), np.array([1.0, 2.0, 3.0]))
    centre = np.array([0.3, 0.1, -0.7])
    half = part_of(motion, 0.5, centre)
    np.testing.assert_allclose(half.R @ half.R, motion.R, atol=1e-14)
    np.testing.assert_allclose(half(centre), (centre + motion(centre)) / 2, atol=1e-14)
    np.testing.assert_allclose(part_of(motion, 1.0, centre).t, motion.t, atol=1e-14)


DISTANCES = np.array([0.0, 1e-3, 0.01, 0.03, 0.2, 4.0])


def test_loss_weights_are_slopes_of_the_cost() -> None:
    for loss in [LeastSquares(), GemanMcClure(0.02)]:
        h = 1e-7
        slope = (loss.costs(DISTANCES[1:] + h) - loss.costs(DISTANCES[1:] - h)) / (2 * h)
        np.testing.assert_allclose(
            loss.weights(DISTANCES)[1:] * DISTANCES[1:], slope, atol=1e-9, rtol=1e-6
        )
        assert loss.weights(DISTANCES)[0] == 1


def test_weighted_squares_majorize_the_loss() -> None:
    """Why a step that lowers the weighted squares lowers the loss."""
    for loss in [LeastSquares(), GemanMcClure(0.02), Trimmed(0.5)]:
        rng = np.random.default_rng(0)
        here = rng.exponential(0.05, 50)
        weights, cost = loss.weights(here), loss.costs(here).sum()
        for _ in range(200):
            there = here * rng.exponential(1.0, 50)
            assert loss.costs(there).sum() <= cost + weights @ (there**2 - here**2) / 2 + 1e-15


def test_losses_have_known_values() -> None:
    robust = GemanMcClure(0.02)
    np.testing.assert_allclose(robust.costs(np.array([0.02, 1e6])), [1e-4, 2e-4], rtol=1e-6)
    assert robust.weights(np.array([0.02])) == pytest.approx([0.25])
    np.testing.assert_array_equal(Trimmed(0.5).weights(DISTANCES[::-1]), [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(Trimmed(1e-9).weights(DISTANCES), [1, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(Trimmed(1.0).costs(DISTANCES), LeastSquares().costs(DISTANCES))


def test_loss_scale_is_positive() -> None:
    for scale in [0, -1.0, np.nan, np.inf]:
        with pytest.raises(BadArgument, match="must be above 0 m"):
            GemanMcClure(scale)


def test_trimmed_share_is_at_most_one() -> None:
    for share in [0, -1.0, np.nan, 1.01]:
        with pytest.raises(BadArgument, match="above 0 and at most 1"):
            Trimmed(share)


CLOUD_RNG = np.random.default_rng(0)
CLOUD = CLOUD_RNG.normal(size=(40, 3))
CLOUD_NORMALS = CLOUD / np.linalg.norm(CLOUD, axis=1, keepdims=True)
ASKED = CLOUD_RNG.normal(size=(15, 3))


def test_cloud_finds_the_nearest_point() -> None:
    every = np.linalg.norm(ASKED[:, None] - CLOUD, axis=2)
    found = PointCloud(CLOUD).closest(ASKED)
    np.testing.assert_array_equal(found.faces, every.argmin(axis=1))
    np.testing.assert_allclose(found.distances, every.min(axis=1), atol=1e-15)
    np.testing.assert_array_equal(found.points, CLOUD[found.faces])
    np.testing.assert_array_equal(found.normals, np.zeros((15, 3)))
    np.testing.assert_array_equal(found.shares, np.tile([1.0, 0, 0], (15, 1)))


def test_cloud_respects_gate_and_normals() -> None:
    every = np.linalg.norm(ASKED[:, None] - CLOUD, axis=2)
    n = ASKED / np.linalg.norm(ASKED, axis=1, keepdims=True)
    every[n @ CLOUD_NORMALS.T < 0.8] = np.inf
    found = PointCloud(CLOUD[:16], CLOUD_NORMALS[:16]).closest(ASKED, 0.9, n, 0.8)
    least = every[:, :16].min(axis=1)
    there = least <= 0.9
    assert 0 < there.sum() < 15
    np.testing.assert_array_equal(found.faces, np.where(there, every[:, :16].argmin(axis=1), -1))
    np.testing.assert_array_equal(found.distances, np.where(there, least, 0.9))
    np.testing.assert_array_equal(found.points[~there], ASKED[~there])
    assert not found.normals[~there].any()
    np.testing.assert_array_equal(found.normals[there], CLOUD_NORMALS[found.faces[there]])


def test_bad_clouds_are_refused() -> None:
    for points, normals, said in [
        (np.zeros((0, 3)), None, r"points of a cloud must be an array \(M, 3\)"),
        (np.zeros((4, 2)), None, r"not \(4, 2\)"),
        ([[np.nan, 0, 0]], None, "leave out what was not measured"),
        (CLOUD, CLOUD_NORMALS[:3], r"normals of a cloud must be an array \(40, 3\)"),
    ]:
        with pytest.raises(BadArgument, match=said):
            PointCloud(points, normals)


def test_examples_in_docstrings() -> None:
    for module in [icp, icp_steps]:
        failed, tried = doctest.testmod(module)
        assert tried > 0
        assert failed == 0
