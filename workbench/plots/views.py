"""What cameras saw: bodies over images."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from matplotlib.transforms import ScaledTranslation

from workbench.arrays import Array
from workbench.experiments.running import Outcome, Overlay
from workbench.fitting.keypoints import COUNTED, LEAST_CONFIDENCE, reprojection_errors
from workbench.plots.body import painted
from workbench.plots.palette import BLUE, FAINT, OUTSIDE, VERMILLION
from workbench.plots.style import plain

LEGEND_BELOW = 36  # points that the numbers and the label of the axis take


def plot_overlay(outcome: Outcome, view: int, *, ax: Axes, shape: float = 1.25) -> Axes:
    """The body in view number `view`, with observed and fitted keypoints.

    Circles are observed keypoints, the more opaque the higher their confidence. Crosses are the
    same points on the fitted body. Lines join the pairs.

    All in pixels, v down, cropped to the person; `shape` is the crop's height over width.
    """
    faces = None if outcome.setup.body is None else outcome.setup.body.faces
    overlay = outcome.overlays[view]
    seen = overlay.view.confidence > 0
    observed, projected = overlay.view.observed[seen], overlay.projected[seen]
    opacity = np.clip(overlay.view.confidence[seen], 0, 1)
    ax.set_facecolor(OUTSIDE)
    frame = Rectangle((0, 0), *overlay.view.size, facecolor="white", edgecolor=FAINT, linewidth=0.8)
    ax.add_patch(frame).set_zorder(0.5)
    if faces is not None:
        solid = _solid(overlay, overlay.vertices)
        ax.add_collection(painted(overlay.surface, solid, faces, contrast=0.4)).set_zorder(1)
    faded = [(*to_rgb(VERMILLION), float(alpha)) for alpha in opacity]
    pairs = LineCollection(
        list(np.stack([observed, projected], axis=1)), colors=faded, linewidths=1.0
    )
    ax.add_collection(pairs).set_zorder(2)
    u, v = overlay.projected.T
    ax.scatter(u, v, marker="x", s=30, c=BLUE, linewidths=1.4, zorder=3, label="fitted")
    ax.scatter(
        observed[:, 0],
        observed[:, 1],
        s=42,
        facecolors="none",
        edgecolors=faded,
        linewidths=1.7,
        zorder=4,
        label="observed",
    )
    (left, right), (top, bottom) = window(overlay, shape)
    ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")  # v down
    ax.set(xlabel="u (px)", ylabel="v (px)")
    ax.set_title(_title(overlay), loc="left")
    below = ScaledTranslation(0, -LEGEND_BELOW / 72, ax.figure.dpi_scale_trans)
    legend = ax.legend(
        loc="upper left",
        bbox_to_anchor=(0, 0),
        bbox_transform=ax.transAxes + below,
        ncols=2,
        borderaxespad=0,
        columnspacing=1.2,
    )
    for handle in legend.legend_handles[1:]:
        if handle is not None:
            handle.set_edgecolor(VERMILLION)  # type: ignore[attr-defined]  # whatever the first one's confidence
    return ax


def caption_overlay(outcome: Outcome, view: int) -> str:
    """What `plot_overlay` shows."""
    overlay = outcome.overlays[view]
    error, count = reprojection(overlay)
    unseen = int(np.sum(overlay.view.confidence <= 0))
    if not count:
        return (
            f"{overlay.view.name}: no keypoint was observed with a confidence above "
            f"{LEAST_CONFIDENCE}."
        )
    off = np.linalg.norm(overlay.projected - overlay.view.observed, axis=1)
    off = np.where(overlay.view.confidence > LEAST_CONFIDENCE, off, -1.0)
    worst = int(np.argmax(off))
    held_out = "; this view was not fitted" if overlay.view.held_out else ""
    were = "was" if unseen == 1 else "were"
    missing = f" {unseen} {were} not observed at all." if unseen else ""
    return (
        f"{overlay.view.name}{held_out}. {count} {COUNTED} lie on average {error:.1f} px "
        f"from those of the fitted body; the farthest, "
        f"{overlay.landmarks[worst].replace('_', ' ')}, by {off[worst]:.1f} px.{missing}"
    )


def reprojection(overlay: Overlay) -> tuple[float, int]:
    """The mean distance (px) of the keypoints of sufficient confidence, and their number."""
    off = reprojection_errors(overlay.view.observed, overlay.projected, overlay.view.confidence)
    return (float(off.mean()) if off.size else float("nan")), off.size


def window(overlay: Overlay, shape: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits of u and v (px) around person and keypoints, with a margin, height = shape x width."""
    well = overlay.view.observed[overlay.view.confidence > 0]
    shown = np.vstack([overlay.surface, overlay.projected, well])
    shown = shown[np.isfinite(shown).all(axis=1)]
    if not len(shown):
        return (0.0, float(overlay.view.size[0])), (0.0, float(overlay.view.size[1]))
    low, high = shown.min(axis=0), shown.max(axis=0)
    middle, extent = (low + high) / 2, 1.14 * np.maximum(high - low, 10.0)
    width = float(max(extent[0], extent[1] / shape))
    u, v = float(middle[0]), float(middle[1])
    return (u - width / 2, u + width / 2), (v - shape * width / 2, v + shape * width / 2)


def _title(overlay: Overlay) -> str:
    error, count = reprojection(overlay)
    name = plain(overlay.view.name) + (" (held out)" if overlay.view.held_out else "")
    return f"{name}: mean {error:.1f} px, {count} points" if count else f"{name}: nothing seen"


def _solid(overlay: Overlay, surface: Array) -> Array:
    """The surface for the viewer in pixels, depth included: right, up, towards.

    How many pixels make a metre follows from the spread of the vertices, which projection
    scales and turning leaves alone.
    """
    spread, depth, flat = np.var(surface, axis=0).sum(), np.var(overlay.depth), overlay.surface
    finite = np.isfinite(flat).all(axis=1) & (overlay.depth > 0)
    scale = np.sqrt(np.var(flat[finite], axis=0).sum() / max(spread - depth, 1e-12))
    solid = np.column_stack([flat[:, 0], -flat[:, 1], -scale * overlay.depth])
    solid[overlay.depth <= 0] = np.nan  # behind the camera: not painted
    return solid
