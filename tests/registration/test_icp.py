"""Rigid registration: steps, losses, the loop, clouds, and the basins of starts."""

import doctest
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from tests.tiers import few
from workbench.arrays import Array
from workbench.bodies.catalogue import load_body
from workbench.errors import BadArgument
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    Alignment,
    Contacts,
    GemanMcClure,
    Icp,
    IcpIterate,
    LeastSquares,
    PointCloud,
    Stopped,
    distance_gauss_newton,
    icp,
    icp_steps,
    point_to_plane,
    point_to_point,
    random_surface_points,
)
from workbench.registration.icp_steps import Loss, Step

STEPS_RNG = np.random.default_rng(3)
CUBE = trimesh.creation.box((1.0, 1.2, 1.6))
BOX = SurfaceTree(CUBE.vertices, CUBE.faces)
POINTS = STEPS_RNG.normal(size=(60, 3))
WEIGHTS = STEPS_RNG.uniform(0.5, 2.0, 60)
EACH = pytest.mark.parametrize("step", [distance_gauss_newton, point_to_plane, point_to_point])


def contacts(points: Array = POINTS) -> Contacts:
    nearest = BOX.closest(points)
    return Contacts(points, nearest.points, nearest.normals, WEIGHTS)


def cost(x: Array) -> float:
    """Half the weighted squares of distances after the motion (w, v), contacts chosen anew."""
    d = BOX.closest(POINTS @ matrix_from_vector(x[:3]).T + x[3:]).distances
    return float(WEIGHTS @ d**2) / 2


def test_gradient_with_frozen_contacts_is_exact() -> None:
    """At faces, edges and vertices alike, by differences of the cost with contacts chosen anew."""
    nearest = BOX.closest(POINTS)
    at_faces = np.count_nonzero(nearest.shares > 1e-12, axis=1)
    assert {1, 2, 3} <= set(at_faces.tolist())
    off = POINTS - nearest.points
    u = off / np.linalg.norm(off, axis=1, keepdims=True)
    J = np.column_stack([np.cross(POINTS, u), u])
    gradient = J.T @ (WEIGHTS * np.linalg.norm(off, axis=1))
    h = 1e-5
    differences = [(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(6)]
    np.testing.assert_allclose(gradient, differences, rtol=1e-8, atol=1e-8)


def test_gauss_newton_solves_the_normal_equations_of_the_distance() -> None:
    on_box = contacts()
    off = POINTS - on_box.closest
    d = np.linalg.norm(off, axis=1)
    u = off / d[:, None]
    centre = WEIGHTS @ POINTS / WEIGHTS.sum()
    J = np.column_stack([np.cross(POINTS - centre, u), u])
    root = np.sqrt(WEIGHTS)
    x = np.linalg.lstsq(root[:, None] * J, -root * d)[0]
    step = distance_gauss_newton(on_box)
    np.testing.assert_allclose(step.R, matrix_from_vector(x[:3]), atol=1e-12)
    np.testing.assert_allclose(step(centre), centre + x[3:], atol=1e-12)


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


def test_weighted_squares_majorize_the_loss() -> None:
    """Why a step that lowers the weighted squares lowers the loss."""
    for loss in [LeastSquares(), GemanMcClure(0.02)]:
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


CLOUD_RNG = np.random.default_rng(0)
CLOUD = CLOUD_RNG.normal(size=(40, 3))
CLOUD_NORMALS = CLOUD / np.linalg.norm(CLOUD, axis=1, keepdims=True)
ASKED = CLOUD_RNG.normal(size=(15, 3))


def test_cloud_respects_gate_and_normals() -> None:
    every = np.linalg.norm(ASKED[:, None] - CLOUD, axis=2)
    n = ASKED / np.linalg.norm(ASKED, axis=1, keepdims=True)
    every[n @ CLOUD_NORMALS.T < 0.8] = np.inf
    nearest = PointCloud(CLOUD[:16], CLOUD_NORMALS[:16]).closest(ASKED, 0.9, n, 0.8)
    least = every[:, :16].min(axis=1)
    there = least <= 0.9
    assert 0 < there.sum() < 15
    np.testing.assert_array_equal(nearest.faces, np.where(there, every[:, :16].argmin(axis=1), -1))
    np.testing.assert_array_equal(nearest.distances, np.where(there, least, 0.9))
    np.testing.assert_array_equal(nearest.points[~there], ASKED[~there])
    assert not nearest.normals[~there].any()
    np.testing.assert_array_equal(nearest.normals[there], CLOUD_NORMALS[nearest.faces[there]])


def test_examples_in_docstrings() -> None:
    for module in [icp, icp_steps]:
        failed, tried = doctest.testmod(module)
        assert tried > 0
        assert failed == 0


BODY = load_body("small")
SURFACE = SurfaceTree(BODY.template, BODY.faces)
RNG = np.random.default_rng(5)
RIGHT, NORMALS = random_surface_points(BODY.template, BODY.faces, 300, RNG)
TRUTH = Similarity(matrix_from_vector([0.1, 0.3, -0.2]), np.array([0.05, -0.1, 0.08]))
SCAN = TRUTH.inverse()(RIGHT)
LOSSES = pytest.mark.parametrize("loss", [LeastSquares(), GemanMcClure(0.03)], ids=str)


def off(alignment: Alignment, points: Array = SCAN, right: Array = RIGHT) -> float:
    """m, the largest distance of a point from its true place."""
    return float(np.linalg.norm(alignment.motion(points) - right, axis=1).max())


@EACH
def test_motion_is_recovered(step: Step) -> None:
    """The points lie on the surface, so that nothing else is as good; Gauss-Newton is quadratic at
    the end, and alternation halves at best.
    """
    alignment = Icp(step, max_iterations=400, tolerance=1e-9).align(SCAN, SURFACE)
    assert alignment.stopped is Stopped.SETTLED
    np.testing.assert_allclose(alignment.R, TRUTH.R, atol=1e-6)
    np.testing.assert_allclose(alignment.t, TRUTH.t, atol=1e-6)
    assert alignment.rms < 1e-6
    assert alignment.in_contact == 1
    assert alignment.iterations >= 40 if step is point_to_point else alignment.iterations <= 10


@LOSSES
@pytest.mark.parametrize("gate", few([0.05, np.inf], 1))
def test_cost_of_alternation_never_rises(loss: Loss, gate: float) -> None:
    rng = np.random.default_rng(1)
    noisy = SCAN + 0.005 * rng.normal(size=SCAN.shape)
    noisy[:30] += 0.3 * rng.normal(size=(30, 3))
    for k in range(2):
        start = Similarity(matrix_from_vector(0.5 * rng.normal(size=3)), 0.1 * rng.normal(size=3))
        icp = Icp(point_to_point, loss, gate=gate, max_iterations=60)
        weights = rng.uniform(0, 2, len(noisy)) if k else None
        costs = np.array([i.cost for i in icp.align(noisy, SURFACE, start, weights=weights).trace])
        assert len(costs) > 5
        assert np.all(np.diff(costs) <= 1e-14)


def test_trace_has_costs_and_moves() -> None:
    seen: list[IcpIterate] = []
    alignment = Icp(point_to_point, max_iterations=5).align(
        SCAN, SURFACE, TRUTH, callback=seen.append
    )
    assert tuple(seen) == alignment.trace
    first = alignment.trace[0]
    assert (first.moved, first.in_contact) == (0, 1)
    far = Icp(point_to_point, max_iterations=3).align(SCAN, SURFACE)
    assert (far.stopped, far.iterations, len(far.trace)) == (Stopped.OUT_OF_ITERATIONS, 3, 4)
    places = [one.motion(SCAN) for one in far.trace]
    for before, after, one in zip(places, places[1:], far.trace[1:], strict=False):
        np.testing.assert_allclose(np.linalg.norm(after - before, axis=1).max(), one.moved)
    d = SURFACE.closest(places[2]).distances
    np.testing.assert_allclose(far.trace[2].cost, np.sum(d**2) / 2)
    np.testing.assert_allclose(far.trace[2].rms, np.sqrt(np.mean(d**2)))
    A = Similarity(matrix_from_vector([1.0, -2.0, 0.4]), np.array([3.0, 1.0, -2.0]))
    other = Icp(point_to_point, max_iterations=3).align(A(SCAN), SURFACE, A.inverse())
    np.testing.assert_allclose(other.motion(A(SCAN)), places[-1], atol=1e-8)  # given elsewhere


def test_outliers_do_not_pull() -> None:
    """A fifth of the points is clutter that stands to one side."""
    clutter = np.concatenate([SCAN, SCAN[:75] * 0.3 + [0.5, 0.2, 0.0]])
    for step, loss, robust in [
        (distance_gauss_newton, GemanMcClure(0.03), True),
        (point_to_plane, GemanMcClure(0.03), True),
        (distance_gauss_newton, LeastSquares(), False),
    ]:
        alignment = Icp(step, loss, max_iterations=300).align(clutter, SURFACE)
        assert (
            off(alignment, clutter[:300]) < 1e-3 if robust else off(alignment, clutter[:300]) > 0.01
        )


def test_gate_leaves_out_far_points() -> None:
    clutter = np.concatenate([SCAN, SCAN[:75] + [0.0, 0.0, 1.5]])
    alignment = Icp(gate=0.15).align(clutter, SURFACE)
    assert off(alignment, clutter[:300]) < 1e-6
    assert alignment.in_contact == pytest.approx(0.8, abs=0.01)
    assert alignment.rms < 1e-6  # of the points in contact alone
    assert alignment.cost == pytest.approx(75 * 0.15**2 / 2, rel=0.02)  # and the others at the gate


def test_normals_tell_back_from_front() -> None:
    """Points of the front alone, begun behind the back: normals send them through the body."""
    chosen = NORMALS[:, 2] > 0.5
    points, normals = RIGHT[chosen], NORMALS[chosen]
    behind = Similarity(np.eye(3), np.array([0.0, 0.0, -0.15]))
    told = Icp().align(points, SURFACE, behind, normals=normals)
    untold = Icp().align(points, SURFACE, behind)
    assert off(told, points, points) < 1e-6
    assert told.iterations <= untold.iterations / 2
    first = SURFACE.closest(behind(points), normals=normals)
    assert told.trace[0].cost == pytest.approx(np.sum(first.distances**2) / 2)


@pytest.mark.thorough
@EACH
def test_clouds_are_targets(step: Step) -> None:
    """The scan is some of the cloud's own points, so that there is a place without an error."""
    dense, normals = random_surface_points(BODY.template, BODY.faces, 4000, RNG)
    some = TRUTH.inverse()(dense[::10])
    alignment = Icp(step, max_iterations=300).align(some, PointCloud(dense, normals))
    assert off(alignment, some, dense[::10]) < 5e-3
    if step is not point_to_plane:
        assert (
            off(Icp(step).align(dense[::10], PointCloud(dense)), dense[::10], dense[::10]) < 1e-12
        )


def test_steps_that_raise_the_cost_are_halved() -> None:
    """A form of one's own that overshoots eightfold ends only with halvings."""

    def eightfold(contacts: Contacts) -> Similarity:
        motion = point_to_point(contacts)
        turn = matrix_from_vector(8 * vector_from_matrix(motion.R))
        centre = contacts.points.mean(axis=0)
        return Similarity(turn, 8 * (motion(centre) - centre) + centre - turn @ centre)

    cloud = PointCloud(RIGHT)
    plain = Icp(eightfold, max_iterations=30, halvings=0).align(SCAN, cloud)
    halved = Icp(eightfold, max_iterations=100, halvings=6).align(SCAN, cloud)
    costs = [one.cost for one in halved.trace]
    assert np.all(np.diff(costs) <= 1e-12)
    assert off(halved) < 1e-3 < off(plain)


def test_bad_arguments_of_icp_are_refused() -> None:
    some = Contacts(POINTS, POINTS, 0 * POINTS, WEIGHTS)
    arguments = {"points": SCAN, "target": SURFACE}
    for bad, said in [
        (lambda: Icp().align(**arguments | {"points": SCAN[:, :2]}), r"an array \(M, 3\)"),
        (
            lambda: Icp().align(**arguments | {"points": SCAN / 0}),
            "leave out what was not measured",
        ),
        (lambda: Icp().align(**arguments, weights=np.ones(3)), "300 finite numbers, one for each"),
        (lambda: Icp().align(**arguments, normals=NORMALS[:3]), r"\(300, 3\), one for each point"),
        (lambda: Icp().align(**arguments, start=replace(TRUTH, scale=2.0)), "of scale 1, not 2.0"),
        (lambda: Icp(gate=0.0), "the gate must be a distance above 0 m"),
        (lambda: Icp(tolerance=-1.0), "tolerance of ICP must be finite .* not -1.0"),
        (lambda: GemanMcClure(np.inf), "scale of a robust loss must be finite"),
        (lambda: PointCloud(np.zeros((0, 3))), r"points of a cloud must be an array \(M, 3\)"),
        (lambda: point_to_plane(some), "needs normals of the target, which has none"),
    ]:
        with np.errstate(all="ignore"), pytest.raises(BadArgument, match=said):
            bad()


def test_random_points_are_uniform_over_area() -> None:
    """A big triangle and a small one: points by area, means at the centroids, true normals."""
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 5], [1, 0, 5], [0, 0, 6.0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    points, normals = random_surface_points(vertices, faces, 20000, np.random.default_rng(1))
    big = points[:, 2] < 1e-9
    assert big.mean() == pytest.approx(0.9, abs=0.01)
    np.testing.assert_allclose(points[big].mean(axis=0), [1, 1, 0], atol=0.03)
    np.testing.assert_allclose(points[~big].mean(axis=0), [1 / 3, 0, 16 / 3], atol=0.03)
    within = points[big]
    assert (within >= 0).all()
    assert (within.sum(axis=1) <= 3 + 1e-12).all()
    assert np.mean(within.sum(axis=1) <= 1.5) == pytest.approx(0.25, abs=0.02)
    np.testing.assert_allclose(normals, np.where(big[:, None], [0, 0, 1], [0, -1, 0]), atol=1e-15)
