"""The three forms of a step."""

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
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
)
from workbench.registration.icp_steps import Step, part_of

RNG = np.random.default_rng(3)
CUBE = trimesh.creation.box((1.0, 1.2, 1.6))
BOX = SurfaceTree(CUBE.vertices, CUBE.faces)
POINTS = RNG.normal(size=(60, 3))
WEIGHTS = RNG.uniform(0.5, 2.0, 60)
EACH = pytest.mark.parametrize("step", [distance_gauss_newton, point_to_plane, point_to_point])


def contacts(points: Array = POINTS) -> Contacts:
    found = BOX.closest(points)
    return Contacts(points, found.points, found.normals, WEIGHTS)


def cost(x: Array) -> float:
    """Half the weighted squares of distances after the motion (w, v), contacts chosen anew."""
    d = BOX.closest(POINTS @ matrix_from_vector(x[:3]).T + x[3:]).distances
    return float(WEIGHTS @ d**2) / 2


def test_the_derivative_with_frozen_contacts_is_that_of_the_distance() -> None:
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


def test_inside_of_faces_it_is_the_step_to_the_planes() -> None:
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
def test_a_step_does_not_depend_on_the_frame(step: Step) -> None:
    """Where the frame is, points and target moved together, is nothing to the motion."""
    frame = Similarity(matrix_from_vector([0.3, 1.0, -2.0]), np.array([5.0, -3.0, 2.0]))
    one = contacts()
    moved = Contacts(frame(one.points), frame(one.closest), one.normals @ frame.R.T, WEIGHTS)
    expected = frame.after(step(one)).after(frame.inverse())
    np.testing.assert_allclose(step(moved).R, expected.R, atol=1e-10)
    np.testing.assert_allclose(step(moved).t, expected.t, atol=1e-9)


@EACH
def test_points_in_place_stay_there(step: Step) -> None:
    still = step(Contacts(POINTS, POINTS, contacts().normals, WEIGHTS))
    np.testing.assert_allclose(still.R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(still.t, 0, atol=1e-12)


@EACH
@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_take_a_short_step(step: Step, count: int) -> None:
    """One, two or three distances leave motions open, and the step takes none of these."""
    few = Contacts(*(x[:count] for x in (POINTS, contacts().closest, contacts().normals, WEIGHTS)))
    motion = step(few)
    assert np.isfinite(motion.R).all()
    moved = np.linalg.norm(motion(few.points) - few.points, axis=1).max()
    assert moved <= 3 * np.linalg.norm(few.points - few.closest, axis=1).max()


def test_on_a_plane_nothing_slides() -> None:
    flat = np.column_stack([RNG.uniform(-1, 1, (20, 2)), np.full(20, 0.3)])
    down = flat * [1, 1, 0]
    some = Contacts(flat, down, np.tile([0.0, 0.0, 1.0], (20, 1)), np.ones(20))
    for step in (distance_gauss_newton, point_to_plane, point_to_point):
        np.testing.assert_allclose(step(some).t, [0, 0, -0.3], atol=1e-12)
        np.testing.assert_allclose(step(some).R, np.eye(3), atol=1e-12)


def test_planes_need_normals() -> None:
    with pytest.raises(BadArgument, match="needs normals of the target, which has none"):
        point_to_plane(Contacts(POINTS, POINTS, 0 * POINTS, WEIGHTS))


def test_two_halves_of_a_motion_about_a_point_on_its_way() -> None:
    motion = Similarity(matrix_from_vector([0.2, -0.4, 1.0]), np.array([1.0, 2.0, 3.0]))
    centre = np.array([0.3, 0.1, -0.7])
    half = part_of(motion, 0.5, centre)
    np.testing.assert_allclose(half.R @ half.R, motion.R, atol=1e-14)
    np.testing.assert_allclose(half(centre), (centre + motion(centre)) / 2, atol=1e-14)
    np.testing.assert_allclose(part_of(motion, 1.0, centre).t, motion.t, atol=1e-14)
