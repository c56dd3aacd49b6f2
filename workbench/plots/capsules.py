"""A posed body with its capsules, and where they are nearest to each other or overlap most."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.ticker import MultipleLocator

from workbench.arrays import Array, Index
from workbench.bodies.capsules import PosedCapsules
from workbench.plots.body import front, painted, side
from workbench.plots.palette import BLUE, FAINT, INK, VERMILLION

PALE = (0.93, 0.91, 0.89)
HALF = np.linspace(-np.pi / 2, np.pi / 2, 25)  # of the round end of a capsule


def plot_capsules(vertices: Array, faces: Index, posed: PosedCapsules, *, ax: Axes) -> Axes:
    """A body (N, 3) m and the outlines of its capsules, from the front and from the side.

    The two capsules with the smallest gap are filled, and a ring marks the place between them.
    """
    pair = () if posed.deepest is None else tuple(posed.pairs[posed.deepest].tolist())
    at, places = 0.0, []
    low, high = float(vertices[:, 1].min()), float(vertices[:, 1].max())
    gap = 0.12 * (high - low)
    for look in (front, side):
        solid = look(vertices)
        offset = np.array([at - float(solid[:, 0].min()), 0.0])
        ax.add_collection(painted(solid[:, :2] + offset, solid, faces, PALE, 0.35)).set_zorder(1)
        for k, (ends, r) in enumerate(zip(posed.ends, posed.radii, strict=True)):
            outline = _outline(look(ends)[:, :2] + offset, float(r))
            shade = {"facecolor": VERMILLION, "alpha": 0.35} if k in pair else {"fill": False}
            edge = VERMILLION if k in pair else BLUE
            ax.add_patch(Polygon(outline, linewidth=0, zorder=2, **shade))
            ax.add_patch(Polygon(outline, fill=False, edgecolor=edge, linewidth=0.9, zorder=3))
        if posed.deepest is not None:
            x, y = look(posed.places.mean(axis=0)[None])[0, :2] + offset
            ax.plot(x, y, "o", markersize=13, markerfacecolor="none", color=INK, zorder=4)
        width = float(np.ptp(solid[:, 0]))
        places.append(at + width / 2)
        at += width + gap
    ax.set(xlim=(-gap, at), ylim=(low - gap / 2, high + gap / 2), aspect="equal")
    ax.set_xticks(places, ["front", "side"])
    ax.tick_params(axis="x", length=0)
    ax.yaxis.set_major_locator(MultipleLocator(0.25))
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(ylabel="y (m)")
    ax.spines["bottom"].set_visible(False)
    return ax


def caption_capsules(posed: PosedCapsules) -> str:
    """What `plot_capsules` shows."""
    count = f"The body and its {len(posed.radii)} capsules, without perspective."
    if posed.deepest is None:
        return f"{count} No pair of them is kept apart."
    one, other = (posed.names[k].replace("_", " ") for k in posed.pairs[posed.deepest])
    mm = 1e3 * float(posed.gaps[posed.deepest])
    said = (
        f"overlap most, by {-mm:.1f} mm"
        if mm < 0
        else f"are nearest, with {mm:.1f} mm between them"
    )
    return f"{count} Of {len(posed.gaps)} pairs {one} and {other} {said}: filled, and ringed."


def _outline(ends: Array, r: float) -> Array:
    """The outline (n, 2) of a capsule in the plane with ends (2, 2)."""
    along = ends[1] - ends[0]
    turn = np.arctan2(along[1], along[0])
    arcs = (HALF + np.pi + turn, HALF + turn)
    circles = [np.column_stack([np.cos(arc), np.sin(arc)]) for arc in arcs]
    return np.vstack([end + r * circle for end, circle in zip(ends, circles, strict=True)])
