"""From which starts a registration ends at the truth."""

import numpy as np
import pytest

from workbench.errors import BadArgument, UnknownName
from workbench.geometry.rigid import Similarity
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_tree import SurfaceTree
from workbench.registration import (
    Alignment,
    BasinMap,
    Icp,
    IcpIterate,
    Stopped,
    basin_map,
    random_surface_points,
)
from workbench.registration.basins import grid

RNG = np.random.default_rng(0)
POINTS = RNG.normal(size=(50, 3))
TRUTH = Similarity(matrix_from_vector([0.5, -1.0, 0.2]), np.array([1.0, 2.0, -3.0]))


def ended(motion: Similarity) -> Alignment:
    """A registration that stays where it began."""
    return Alignment(motion, Stopped.SETTLED, (IcpIterate(motion, 0.0, 0.0, 1.0, 0.0),))


def test_basin_map_measures_turns_and_distances() -> None:
    told: list[tuple[int, int]] = []
    found = basin_map(ended, POINTS, TRUTH, ("z",), 45.0, progress=lambda *at: told.append(at))
    assert found.angles[:, 0].tolist() == [-135, -90, -45, 0, 45, 90, 135, 180]
    np.testing.assert_allclose(found.turned, np.abs(found.angles[:, 0]), atol=1e-5)
    right = TRUTH(POINTS) - TRUTH(POINTS).mean(axis=0)
    radius = np.linalg.norm(right[:, :2], axis=1).mean()  # the turn is about the mean
    expected = 2 * np.sin(np.radians(np.abs(found.angles[:, 0])) / 2) * radius
    np.testing.assert_allclose(found.off, expected, atol=1e-12)
    assert found.found.tolist() == [angle == 0 for angle in found.angles[:, 0]]
    assert found.reach == 0
    whole = basin_map(ended, POINTS, TRUTH, ("z",), 45)  # a whole number of degrees
    assert whole.reach == 0
    assert told == [(k, 8) for k in range(1, 9)]


def test_starts_about_two_axes_compose() -> None:
    starts: list[Similarity] = []

    def align(start: Similarity) -> Alignment:
        starts.append(start)
        return ended(start)

    found = basin_map(align, POINTS, TRUTH, ("x", "y"), 90.0)
    assert found.angles.shape == (16, 2)
    for start, (x, y) in zip(starts, np.radians(found.angles), strict=True):
        R = matrix_from_vector([0, y, 0]) @ matrix_from_vector([x, 0, 0]) @ TRUTH.R
        np.testing.assert_allclose(start.R, R, atol=1e-14)
        middle = TRUTH(POINTS).mean(axis=0)
        np.testing.assert_allclose(start(POINTS).mean(axis=0), middle, atol=1e-12)


def of(found: dict[float, bool]) -> BasinMap:
    S = len(found)
    return BasinMap(
        ("y",),
        np.array(list(found), dtype=float)[:, None],
        np.zeros(S),
        np.where(list(found.values()), 0.0, 1.0),
        np.full(S, 7),
        (Stopped.SETTLED,) * S,
    )


def test_reach_ends_at_the_first_lost_start() -> None:
    assert of({-60: True, -30: True, 0: True, 30: True, 60: True, 90: True}).reach == 90
    assert of({-60: False, -30: True, 0: True, 30: True, 60: True, 90: True}).reach == 30
    assert of({-30: True, 0: True, 30: False}).reach == 0
    assert np.isnan(of({-30: True, 0: False, 30: True}).reach)


def test_grid_has_no_start_twice() -> None:
    for step, count in [(180.0, 2), (120.0, 3), (100.0, 3), (30.0, 12)]:
        angles = grid(["y"], step)[:, 0]
        assert len(angles) == len({angle % 360 for angle in angles}) == count
        assert 0 in angles
        assert np.all(np.diff(angles) == step)


def test_bad_grids_are_refused() -> None:
    with pytest.raises(UnknownName, match="no axis is called 'w'; there are x, y, z"):
        grid(["w"], 30.0)
    with pytest.raises(BadArgument, match="several different ones, not 'y and y'"):
        grid(["y", "y"], 30.0)
    with pytest.raises(BadArgument, match="one axis or several"):
        grid([], 30.0)
    for step in (0.0, -30.0, 181.0, np.nan):
        with pytest.raises(BadArgument, match="above 0 and at most 180 degrees"):
            grid(["y"], step)


@pytest.mark.thorough
def test_ellipsoid_has_known_basins() -> None:
    """Known basins: an ellipsoid looks the same after a half-turn about each of its axes."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices = np.asarray(ball.vertices) * [0.3, 0.5, 0.8]
    surface = SurfaceTree(vertices, ball.faces)
    points, _ = random_surface_points(vertices, ball.faces, 200, RNG)
    found = basin_map(lambda start: Icp().align(points, surface, start), points, TRUE, ("y",))
    angles = np.abs(found.angles[:, 0])
    np.testing.assert_array_equal(found.found[angles != 90], angles[angles != 90] < 90)
    np.testing.assert_allclose(found.turned[angles > 90], 180, atol=0.01)


TRUE = Similarity(np.eye(3), np.zeros(3))


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
    np.testing.assert_allclose(normals[big], np.tile([0, 0, 1.0], (big.sum(), 1)), atol=1e-15)
    np.testing.assert_allclose(normals[~big], np.tile([0, -1.0, 0], ((~big).sum(), 1)), atol=1e-15)
