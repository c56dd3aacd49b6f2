"""Points of a scan that hang together with few others."""

import numpy as np

from workbench.fitting import Scan, loose_points

GRID = np.stack(np.meshgrid(*[np.arange(20.0)] * 2, [0.0]), axis=-1).reshape(-1, 3)
UP = np.tile([0.0, 0.0, 1.0], (len(GRID), 1))


def test_points_of_a_surface_are_not_loose_and_points_beside_it_are() -> None:
    away = np.random.default_rng(0).uniform(3, 30, (20, 3))
    assert np.flatnonzero(loose_points(Scan(np.vstack([GRID, away])))).tolist() == list(
        range(len(GRID), len(GRID) + 20)
    )


def test_a_point_on_a_surface_that_faces_another_way_is_loose() -> None:
    points, normals = np.vstack([GRID, [[9.5, 9.5, 0.0]]]), np.vstack([UP, [[1.0, 0.0, 0.0]]])
    assert not loose_points(Scan(points)).any()
    assert np.flatnonzero(loose_points(Scan(points, normals))).tolist() == [len(GRID)]


def test_the_unit_and_the_order_do_not_matter() -> None:
    points = np.vstack([GRID, [[40.0, 0.0, 5.0]]])
    order = np.random.default_rng(1).permutation(len(points))
    np.testing.assert_array_equal(
        loose_points(Scan(0.001 * points[order])), loose_points(Scan(points))[order]
    )


def test_of_a_few_points_none_is_loose() -> None:
    assert not loose_points(Scan(np.eye(3))).any()
