"""Bodies on paper and over images, registered scans, and names as users write them."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection, PolyCollection

from tests.outcomes_made_up import outcome_made_up
from workbench.plots import (
    caption_body,
    caption_distances,
    caption_shape_gallery,
    plot_distances,
    plot_overlay,
    plot_shape_gallery,
    png,
    sheet,
    smallest,
    svg,
)
from workbench.plots.body import back, front, plot_body, shape_gallery_sheet, side
from workbench.plots.scans import plot_joint_cost
from workbench.plots.style import house_style, plain
from workbench.plots.views import reprojection
from workbench.training.execution import LogEntry

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


def test_overlay_draws_points_where_they_are() -> None:
    outcome = outcome_made_up()
    for i, overlay in enumerate(outcome.overlays):
        _, (ax,) = sheet(4, 5)
        assert plot_overlay(outcome, i, ax=ax) is ax
        crosses, circles = (c for c in ax.collections if isinstance(c, PathCollection))
        np.testing.assert_array_equal(crosses.get_offsets(), overlay.projected)
        seen = overlay.view.confidence > 0
        assert not seen.all()
        np.testing.assert_array_equal(circles.get_offsets(), overlay.view.observed[seen])
        np.testing.assert_array_equal(circles.get_edgecolor()[:, 3], overlay.view.confidence[seen])
        (pairs,) = (c for c in ax.collections if isinstance(c, LineCollection))
        np.testing.assert_array_equal(
            np.array(pairs.get_segments())[:, 0], overlay.view.observed[seen]
        )


def test_overlay_paints_the_body_from_far_to_near() -> None:
    outcome = outcome_made_up()
    overlay, faces = outcome.overlays[0], outcome.setup.body.faces
    _, (ax,) = sheet(4, 5)
    plot_overlay(outcome, 0, ax=ax)
    (mesh,) = (c for c in ax.collections if isinstance(c, PolyCollection))
    painted = np.array([path.vertices[:3] for path in mesh.get_paths()])
    far_first = faces[np.argsort(-overlay.depth[faces].sum(axis=1), kind="stable")]
    np.testing.assert_allclose(painted, overlay.surface[far_first], rtol=1e-12)
    assert mesh.get_rasterized()


def test_reprojection_counts_confident_keypoints() -> None:
    overlay = outcome_made_up().overlays[0]
    off = np.zeros((24, 2))
    off[:, 0] = np.where(overlay.view.confidence > 0.2, 3.0, 1000.0)
    moved = replace(overlay, view=replace(overlay.view, observed=overlay.projected + off))
    error, count = reprojection(moved)
    assert error == pytest.approx(3.0)
    assert count == int(np.sum(overlay.view.confidence > 0.2))


def test_joint_cost_draws_more_terms_than_there_are_marks() -> None:
    costs = {f"E_{k}": 1.0 + k for k in range(12)}
    _, (ax,) = sheet(4, 3)
    plot_joint_cost([LogEntry("model", costs, {name: 0.5 for name in costs}, {}, 0.0)], ax=ax)
    assert len(ax.get_lines()) == 13
    assert ax.get_lines()[0].get_ydata().tolist() == [78.0, 6.0]


def test_dollars_are_no_mathematics() -> None:
    figure, (ax,) = sheet(3, 2)
    ax.set_title(plain(r"$\frac{$ 左"))
    ax.plot(np.arange(3))
    assert png(figure)
    assert svg(figure)


def test_the_users_own_style_is_left_alone() -> None:
    before = dict(matplotlib.rcParams)
    with house_style():
        assert matplotlib.rcParams["legend.frameon"] is False
    assert dict(matplotlib.rcParams) == before


def test_the_same_figure_is_the_same_bytes() -> None:
    def drawn() -> bytes:
        figure, (ax,) = sheet(3, 2)
        ax.plot(np.arange(3))
        return svg(figure)

    assert drawn() == drawn()


def test_lines_are_kept_as_lines_and_paint_as_pixels() -> None:
    figure, (ax,) = sheet(3, 2)
    (line,) = ax.plot(np.arange(3))
    assert smallest(figure) == (svg(figure), "image/svg+xml")
    line.set_rasterized(True)
    assert smallest(figure)[1] == "image/png"
