"""Bodies standing side by side, drawn without perspective and to scale."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike, NDArray

from workbench.plots.lettering import plain
from workbench.plots.palette import FAINT
from workbench.plots.shading import painted

Array = NDArray[np.float64]
Look = Callable[[Array], Array]  # vertices (N, 3) m -> right, up, towards the viewer (N, 3) m


def front(vertices: Array) -> Array:
    """As seen by who stands before it: the body faces +z."""
    return vertices


def side(vertices: Array) -> Array:
    """As seen from its right hand: it looks to the right."""
    x, y, z = vertices.T
    return np.column_stack([z, y, -x])


def back(vertices: Array) -> Array:
    """As seen from behind."""
    x, y, z = vertices.T
    return np.column_stack([-x, y, -z])


@dataclass(frozen=True, eq=False)
class Figurine:
    """One drawing of a body in a line-up."""

    label: str
    vertices: Array  # (N, 3) m
    look: Look = front
    colours: ArrayLike | None = None  # (F, 3)


def plot_body(vertices: Array, faces: NDArray[np.int64], *, ax: Axes) -> Axes:
    """A body (N, 3) m from the front and from the side."""
    shown = (Figurine("front", vertices), Figurine("side", vertices, side))
    return line_up(shown, faces, ax=ax)


def caption_body(vertices: Array) -> str:
    """What `plot_body` shows."""
    wide, tall, deep = np.ptp(vertices, axis=0)
    return (
        f"The template from the front and from its right side, without perspective: "
        f"{tall:.2f} m tall, {wide:.2f} m from hand to hand, {deep:.2f} m deep."
    )


def plot_shape_gallery(shapes: Mapping[str, Array], faces: NDArray[np.int64], *, ax: Axes) -> Axes:
    """Several shapes (N, 3) m of one body by name, from the front, on one scale."""
    return line_up([Figurine(name, v) for name, v in shapes.items()], faces, ax=ax)


def caption_shape_gallery(shapes: Mapping[str, Array], ends: str = "two") -> str:
    """What `plot_shape_gallery` shows: shapes at `ends` standard deviations."""
    heights = {name: float(np.ptp(v[:, 1])) for name, v in shapes.items()}
    low, high = min(heights, key=heights.__getitem__), max(heights, key=heights.__getitem__)
    return (
        f"Each shape direction alone at plus and minus {ends} standard deviations. The tallest, "
        f"{high}, has {heights[high]:.2f} m; the shortest, {low}, {heights[low]:.2f} m."
    )


def line_up(
    figurines: tuple[Figurine, ...] | list[Figurine],
    faces: NDArray[np.int64],
    *,
    ax: Axes,
    contrast: float = 0.5,
) -> Axes:
    """Draw bodies from left to right, named below, heights in metres on one scale."""
    solids = [f.look(f.vertices) for f in figurines]
    gap = 0.12 * max(float(np.ptp(s[:, 1])) for s in solids)
    at, places = 0.0, []
    for figurine, solid in zip(figurines, solids, strict=True):
        left, right = float(solid[:, 0].min()), float(solid[:, 0].max())
        flat = solid[:, :2] + [at - left, 0.0]
        ax.add_collection(painted(flat, solid, faces, figurine.colours, contrast))
        places.append(at + (right - left) / 2)
        at += right - left + gap
    low = min(float(s[:, 1].min()) for s in solids)
    high = max(float(s[:, 1].max()) for s in solids)
    ax.set_xlim(-gap, at)
    ax.set_ylim(low - gap / 2, high + gap / 2)
    ax.set_aspect("equal")
    ax.set_xticks(places, [plain(f.label) for f in figurines])
    ax.tick_params(axis="x", length=0)
    ax.yaxis.set_major_locator(MultipleLocator(_step(high - low)))
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set_ylabel("y (m)")
    ax.set_xlabel("the same scale across as up")
    ax.spines["bottom"].set_visible(False)
    return ax


def _step(extent: float) -> float:
    """A round distance between ticks, four to ten to the extent."""
    ten = 10.0 ** np.floor(np.log10(max(extent, 1e-9)))
    return float(next(ten * s for s in (0.1, 0.2, 0.25, 0.5, 1.0, 2.0) if extent / (ten * s) <= 6))
