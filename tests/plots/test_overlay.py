"""What is drawn over an image is what was computed, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection, PolyCollection

from tests.outcomes_made_up import outcome_made_up
from workbench.plots import caption_overlay, plot_overlay, png, sheet, svg
from workbench.plots.views import reprojection


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


@pytest.mark.thorough
def test_nothing_seen_and_a_body_behind_the_camera_are_drawn_too() -> None:
    outcome = outcome_made_up()
    overlay = outcome.overlays[0]
    depth = overlay.depth.copy()
    depth[::2] = -1.0
    surface = overlay.surface.copy()
    surface[1] = np.nan
    blind = replace(
        overlay,
        view=replace(overlay.view, confidence=np.zeros(24)),
        depth=depth,
        surface=surface,
    )
    figure, (ax,) = sheet(4, 5)
    changed = replace(outcome, overlays=(blind,))
    plot_overlay(changed, 0, ax=ax)
    assert "nothing seen" in ax.get_title("left")
    assert "no keypoint" in caption_overlay(changed, 0)
    assert png(figure).startswith(b"\x89PNG")
    assert b"<svg" in svg(figure)
