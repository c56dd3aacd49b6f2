"""Space that a camera looked through: what stands there, and by how much."""

import numpy as np
import pytest

import workbench as wb
from tests.differences import assert_jacobian
from tests.residuals.test_scans import body_and_scan
from workbench import Block, Problem, residuals
from workbench.errors import BadResidual
from workbench.residuals.free_space import Shadow

WALL = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 101)] * 2), axis=-1).reshape(-1, 2)
SCAN = np.column_stack([WALL, np.zeros(len(WALL))])  # a wall of 1 m, every centimetre a point
CAMERA = np.array([0.0, 0.0, 2.0])
PLACED = Block("placed", (6, 3), "m")


def off(places: list[list[float]], **margins: float) -> np.ndarray:
    """How far places are from the shadow of the wall, in m."""
    given = np.array(places)
    block = Block("placed", given.shape, "m")
    residual = residuals.free_space(block.symbol, SCAN, CAMERA, sigma=0.1, **margins)
    return 0.1 * Problem([residual], "placed").linearize({"placed": given}).residual


def test_what_is_behind_the_scan_may_be_there() -> None:
    assert not off([[0, 0, -0.001], [0.3, -0.4, -3], [0.7, 0, -1]]).any()  # shadows widen


def test_in_front_of_the_scan_it_is_the_way_back() -> None:
    found = off([[0, 0, 0.02], [0, 0, 0.5], [0.2, 0.1, 1.0]])
    depth = np.linalg.norm([0.4, 0.2, 2]) - np.linalg.norm([0.2, 0.1, 1])
    np.testing.assert_allclose(found, [0, 0.47, depth - 0.03], atol=5e-3)


def test_beside_the_scan_it_is_the_way_to_its_rays() -> None:
    across = 0.5 / np.hypot(0.5, 2) * np.array([1, 0, 0.25])  # of the ray along the wall's edge
    there = np.array([0.5, 0, 0]) + 0.1 * across / np.linalg.norm(across)
    ray = np.array([0.5, 0, -2]) / np.hypot(0.5, 2)
    square = np.array([2.0, 0, 0.5]) / np.hypot(0.5, 2)
    np.testing.assert_allclose(
        off([list(CAMERA + 2.5 * ray + 0.1 * square), list(there)]), [0.07, 0.07], atol=6e-3
    )


def test_holes_of_the_scan_are_bridged() -> None:
    hole = np.linalg.norm(SCAN, axis=1) > 0.025
    shadow = Shadow.of(SCAN[hole], CAMERA)
    assert not shadow.distances(np.array([[0.0, 0, -0.1]])).numbers.any()
    wide = Shadow.of(SCAN[np.linalg.norm(SCAN, axis=1) > 0.1], CAMERA)
    assert wide.distances(np.array([[0.0, 0, 0]])).numbers.item() == pytest.approx(0.07, abs=0.01)


def test_a_thin_scan_has_wide_rays() -> None:
    some = np.random.default_rng(0).permutation(len(SCAN))[:200]  # 7 cm apart
    wide = Shadow.of(SCAN[some], CAMERA)
    assert 0.1 < wide.beside < 0.2
    inside = np.column_stack([0.8 * WALL, np.full(len(WALL), -0.1)])
    assert np.mean(wide.distances(inside).numbers > 0) < 0.001
    assert Shadow.of(SCAN, CAMERA).beside == Shadow.of(SCAN[:3], CAMERA).beside == 0.03


def test_what_is_out_of_view_may_be_anywhere() -> None:
    places = [[0.7, 0, 0.2], [0, 0, 0.5], [0, 3, 1.0]]
    assert off(places).min() > 0.1
    np.testing.assert_array_equal(off(places, within=0.05) > 0, [False, True, False])


def test_the_derivative_is_that_of_the_distance() -> None:
    rng = np.random.default_rng(0)
    residual = residuals.free_space(PLACED.symbol, SCAN, CAMERA, sigma=0.1)
    problem = Problem([residual], "placed")
    for _ in range(3):
        x = (rng.uniform(-1, 1, (6, 3)) * [1, 1, 0.5] + [0, 0, 0.5]).ravel()
        assert np.count_nonzero(problem.residual(x, np.zeros(0))) >= 4
        assert_jacobian(problem, x, np.zeros(0), 1e-7)


def test_a_body_is_moved_out_of_empty_space() -> None:
    body, _, values = body_and_scan()
    surface = body.vertices(*values.values())
    camera = surface.mean(axis=0) + [0.0, 0.0, 2.0]
    seen = surface[surface[:, 2] > np.median(surface[:, 2])]
    points = body.points(*(block.symbol for block in body.blocks()))
    residual = residuals.free_space(points, seen, camera, sigma=0.05, beside=0.06)
    problem = Problem([residual], "trans")
    near = values | {"trans": values["trans"] + [0.15, 0.0, 0.1]}
    end = wb.solve(problem, near)
    assert end.cost < 0.1 * problem.linearize(near).cost
    assert np.linalg.norm(end.values["trans"] - values["trans"]) < 0.1


def test_bad_arguments_are_refused() -> None:
    for margins in ({"beside": 0.0}, {"before": -1.0}):
        with pytest.raises(BadResidual, match="margins above 0 m"):
            residuals.free_space(PLACED.symbol, SCAN, CAMERA, sigma=0.1, **margins)
    with pytest.raises(BadResidual, match="at the camera"):
        residuals.free_space(PLACED.symbol, np.vstack([SCAN, CAMERA]), CAMERA, sigma=0.1)
    with pytest.raises(BadResidual, match="camera's place"):
        residuals.free_space(PLACED.symbol, SCAN, [0.0, np.nan, 1.0], sigma=0.1)
