"""Bodies on paper: to scale, upright, seen from where it says."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from workbench.plots import (
    caption_body,
    caption_distances,
    caption_shape_gallery,
    plot_distances,
    plot_shape_gallery,
    plot_stitching,
    png,
    sheet,
)
from workbench.plots.body import back, front, plot_body, shape_gallery_sheet, side

pytestmark = pytest.mark.browser

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
FACES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


def painted(ax) -> list[np.ndarray]:
    meshes = (c for c in ax.collections if isinstance(c, PolyCollection))
    return [np.array([path.vertices[:3] for path in mesh.get_paths()]) for mesh in meshes]


def test_body_is_drawn_to_scale_from_front_and_side() -> None:
    _, (ax,) = sheet(6, 4)
    assert plot_body(CUBE, FACES, ax=ax) is ax
    before, beside = painted(ax)
    np.testing.assert_allclose(np.ptp(before, axis=(0, 1)), [1, 2])
    np.testing.assert_allclose(np.ptp(beside, axis=(0, 1)), [3, 2])
    assert beside[..., 0].min() > before[..., 0].max()
    assert ax.get_aspect() == 1.0
    assert ax.get_ylabel() == "y (m)"
    assert [t.get_text() for t in ax.get_xticklabels()] == ["front", "side"]
    assert "2.00 m tall" in caption_body(CUBE)


@pytest.mark.parametrize(
    ("look", "across", "towards"),
    [(front, (1, 0, 0), (0, 0, 1)), (side, (0, 0, 1), (-1, 0, 0)), (back, (-1, 0, 0), (0, 0, -1))],
)
def test_looks_turn_and_do_not_mirror(look, across, towards) -> None:
    turned = look(np.eye(3)).T  # rows: right, up, towards the viewer
    np.testing.assert_array_equal(turned, [across, (0, 1, 0), towards])
    assert np.linalg.det(turned) == pytest.approx(1)


@pytest.mark.thorough
def test_shapes_stand_side_by_side_on_one_scale() -> None:
    shapes = {"mean": CUBE, "tall $1$ 高": CUBE * [1, 1.5, 1], "wide": CUBE * [2, 1, 1]}
    figure = shape_gallery_sheet(shapes, FACES)
    above, below = figure.get_axes()
    assert above.get_ylim() == below.get_ylim()
    assert np.ptp(above.get_xlim()) == pytest.approx(np.ptp(below.get_xlim()))
    heights = [float(np.ptp(mesh[..., 1])) for mesh in painted(above) + painted(below)]
    assert heights == pytest.approx([2, 3, 2])
    assert png(figure).startswith(b"\x89PNG")
    _, (ax,) = sheet(6, 4)
    plot_shape_gallery(shapes, FACES, ax=ax)
    assert "3.00 m" in caption_shape_gallery(shapes)


def test_distances_have_a_scale_in_millimetres() -> None:
    figure, (ax,) = sheet(6, 4)
    distances = np.linspace(0, 7, len(CUBE))
    plot_distances(CUBE, distances, FACES, ax=ax)
    bar = figure.get_axes()[1]
    assert bar.get_ylabel() == "distance to the truth (mm)"
    assert bar.get_ylim() == (0.0, 7.0)
    assert len(painted(ax)) == 2
    assert "farthest is 7 mm off" in caption_distances(distances)


def test_stitching_draws_torn_triangles() -> None:
    whole = CUBE[FACES]
    middle = whole.mean(axis=1, keepdims=True)
    torn = middle + 0.5 * (whole - middle)
    _, (ax,) = sheet(6, 4)
    plot_stitching({"template": whole, "torn": torn}, ax=ax)
    first, second = painted(ax)
    assert len(first) == len(second) == len(FACES)
    np.testing.assert_allclose(np.ptp(first, axis=1), 2 * np.ptp(second, axis=1), atol=1e-12)
