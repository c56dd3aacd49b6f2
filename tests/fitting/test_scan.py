"""Scans that fit together, and sentences about those that do not."""

import numpy as np
import pytest

from workbench.fitting import BadScan, Scan

POINTS = np.arange(12.0).reshape(4, 3)
NORMALS = np.tile([0.0, 0.6, 0.8], (4, 1))
FACES = np.array([[0, 1, 2], [2, 1, 3]])
AREAS = np.array([1.0, 2.0, 0.0, 4.0])


def test_a_part_of_a_scan_keeps_what_belongs_to_its_points() -> None:
    part = Scan(POINTS, NORMALS, FACES, AREAS).some(np.array([False, True, True, True]))
    assert part.n_points == 3
    np.testing.assert_array_equal(part.points, POINTS[1:])
    np.testing.assert_array_equal(part.faces, [[1, 0, 2]])
    np.testing.assert_array_equal(part.weights, AREAS[1:])


def test_points_alone_are_a_scan() -> None:
    part = Scan(POINTS).some(np.array([True, False, False, False]))
    assert (part.normals, part.faces, part.weights) == (None, None, None)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"points": np.zeros((0, 3))}, "this one is empty"),
        ({"points": np.zeros((3, 2))}, r"are \(M, 3\) m, not \(3, 2\)"),
        ({"points": np.full((2, 3), np.nan)}, r"point 0 is \[nan, nan, nan\]; leave out"),
        (
            {"normals": NORMALS[:2]},
            r"the normals of 4 points must have the shape \(4, 3\), not \(2, 3\)",
        ),
        ({"normals": 2 * NORMALS}, r"normal 0 is .* whose length is not 1; divide"),
        ({"normals": NORMALS * np.nan}, "normal 0 is .* whose length is not 1"),
        ({"faces": FACES.astype(float)}, r"whole numbers \(T, 3\), not float64 \(2, 3\)"),
        ({"faces": FACES + 1}, r"face 1 is \[3, 2, 4\], but the points are 0 to 3"),
        ({"weights": AREAS[:3]}, r"the weights of 4 points must have the shape \(4,\), not \(3,\)"),
        ({"weights": -AREAS}, r"weight 0 is -1 m\^2, and no area is below 0; give 0"),
        ({"weights": 0 * AREAS}, "all weights are 0"),
        ({"weights": AREAS + np.inf}, "weight 0 is inf; leave out"),
    ],
)
def test_what_is_no_scan_is_refused(arguments: dict[str, np.ndarray], sentence: str) -> None:
    with pytest.raises(BadScan, match=sentence):
        Scan(**{"points": POINTS} | arguments)


def test_a_mask_of_another_shape_is_refused() -> None:
    with pytest.raises(BadScan, match=r"by a mask of shape \(4,\), not by an array of bool"):
        Scan(POINTS).some(np.array([True]))
    with pytest.raises(BadScan, match="this one is empty"):
        Scan(POINTS).some(np.zeros(4, dtype=bool))


def test_a_thinned_scan_stands_for_the_same_surface() -> None:
    rng = np.random.default_rng(0)
    points, areas = rng.standard_normal((500, 3)), rng.uniform(0.0, 1.0, 500)
    areas[:100] = 0  # points that do not count are not drawn
    few = Scan(points, weights=areas).thinned(50)
    assert few.n_points == 50
    assert few.weights is not None
    assert few.weights.sum() == pytest.approx(areas.sum())
    numbers = [int(np.flatnonzero((points == p).all(axis=1))[0]) for p in few.points]
    assert min(numbers) >= 100
    assert len(set(numbers)) == 50
    ratio = few.weights / areas[numbers]
    np.testing.assert_allclose(ratio, ratio[0])


def test_a_small_scan_is_not_thinned() -> None:
    scan = Scan(POINTS, NORMALS, FACES, AREAS)
    assert scan.thinned(4) is scan
