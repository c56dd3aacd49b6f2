"""Bodies standing side by side, drawn without perspective and to scale."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.textpath import TextPath
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.geometry.solids import face_vectors, sums_over_faces
from workbench.plots.labels import plain
from workbench.plots.palette import FAINT, SKIN

LETTERS = 9.0  # points, of labels
NARROW = 0.6  # of the axes' width: names that take more in all go on more lines
WHOLE = 0.9  # of it: more than all names together get
MOST_LINES = 4
ROUNDS = 30
Look = Callable[[Array], Array]  # vertices (N, 3) m -> right, up, towards the viewer (N, 3) m
LIGHT = np.array([-0.35, 0.55, 0.76])  # from the upper left, behind the viewer; right, up, towards


def front(vertices: Array) -> Array:
    """The view from the front: the body faces +z."""
    return vertices


def side(vertices: Array) -> Array:
    """The view from the body's right side; it faces to the right."""
    x, y, z = vertices.T
    return np.column_stack([z, y, -x])


def back(vertices: Array) -> Array:
    """The view from behind."""
    x, y, z = vertices.T
    return np.column_stack([-x, y, -z])


@dataclass(frozen=True, eq=False)
class Figurine:
    """One drawing of a body in a line-up.

    Attributes:
        label: the text below it.
        vertices: (N, 3) in metres.
        look: from which side it is drawn.
        colours: (F, 3) for the faces, or one colour for all; None for the colour of skin.
        faces: (F, 3) its own faces, where they are not those of the others.
    """

    label: str
    vertices: Array
    look: Look = front
    colours: ArrayLike | None = None
    faces: Index | None = None


def plot_body(vertices: Array, faces: Index, *, ax: Axes) -> Axes:
    """A body (N, 3) m from the front and from the side."""
    shown = (Figurine("front", vertices), Figurine("side", vertices, side))
    return line_up(shown, faces, ax=ax)


def caption_body(vertices: Array, what: str = "The template") -> str:
    """What `plot_body` shows of `what`."""
    wide, tall, deep = np.ptp(vertices, axis=0)
    return (
        f"{what} from the front and from its right side, without perspective: "
        f"{tall:.2f} m tall, {wide:.2f} m wide, {deep:.2f} m deep."
    )


def plot_shape_gallery(shapes: Mapping[str, Array], faces: Index, *, ax: Axes) -> Axes:
    """Several shapes (N, 3) m of one body by name, from the front, on one scale."""
    return line_up([Figurine(name, v) for name, v in shapes.items()], faces, ax=ax)


def caption_shape_gallery(
    shapes: Mapping[str, Array], ends: str = "two", drawn: str = "Each shape direction"
) -> str:
    """What `plot_shape_gallery` shows: the directions `drawn`, at `ends` standard deviations."""
    heights = {name: float(np.ptp(v[:, 1])) for name, v in shapes.items()}
    low, high = min(heights, key=heights.__getitem__), max(heights, key=heights.__getitem__)
    return (
        f"{drawn} alone, at plus and minus {ends} standard deviations. The tallest body, "
        f"{high}, is {heights[high]:.2f} m tall, and the shortest, {low}, {heights[low]:.2f} m."
    )


def line_up(
    figurines: tuple[Figurine, ...] | list[Figurine],
    faces: Index,
    *,
    ax: Axes,
    contrast: float = 0.5,
) -> Axes:
    """Draw bodies from left to right, named below, heights in metres on one scale.

    Each has at least the room that its name takes, so that no name runs into the next.
    """
    solids = [f.look(f.vertices) for f in figurines]
    gap = 0.12 * max(float(np.ptp(s[:, 1])) for s in solids)
    extents = [float(np.ptp(s[:, 0])) for s in solids]
    inches = ax.bbox.width / ax.figure.dpi
    labels, slots = _room([plain(f.label) for f in figurines], extents, gap, inches)
    at, places = 0.0, []
    for figurine, solid, extent, slot in zip(figurines, solids, extents, slots, strict=True):
        flat = solid[:, :2] + [at + (slot - extent) / 2 - float(solid[:, 0].min()), 0.0]
        own = faces if figurine.faces is None else figurine.faces
        ax.add_collection(painted(flat, solid, own, figurine.colours, contrast))
        places.append(at + slot / 2)
        at += slot + gap
    low = min(float(s[:, 1].min()) for s in solids)
    high = max(float(s[:, 1].max()) for s in solids)
    ax.set(xlim=(-gap, at), ylim=(low - gap / 2, high + gap / 2))
    ax.set_aspect("equal")
    ax.set_xticks(places, labels)
    ax.tick_params(axis="x", length=0)
    ax.yaxis.set_major_locator(MultipleLocator(_step(high - low)))
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(ylabel="y (m)", xlabel="the horizontal scale is the same as the vertical one")
    ax.spines["bottom"].set_visible(False)
    return ax


def _room(
    names: list[str], extents: list[float], gap: float, across: float
) -> tuple[list[str], list[float]]:
    """The names, long ones on several lines, and the width of each place (m) along `across` inches.

    Names that do not fit on any number of lines share the width as they need it.
    """
    labels = names
    for lines in range(2, MOST_LINES + 1):
        if sum(_inches(label) for label in labels) <= NARROW * across:
            break
        width = [-(-len(name) // lines) + 2 for name in names]
        labels = [fill(n, w, break_long_words=False) for n, w in zip(names, width, strict=True)]
    wide = np.array([_inches(label) for label in labels])
    wide *= min(1.0, WHOLE * across / max(wide.sum(), 1e-9))
    slots = np.array(extents)
    for _ in range(ROUNDS):  # a wider place makes the scale smaller, and labels wider on it
        total = slots.sum() + gap * (len(slots) + 1)
        slots = np.maximum(extents, wide / across * total - gap / 2)
    return labels, slots.tolist()


def _inches(label: str) -> float:
    """How wide the longest line of a label is drawn, and the space to the next one."""
    lines = [TextPath((0, 0), line, size=LETTERS) for line in (label + " x").split("\n")]
    return max(float(line.get_extents().width) for line in lines) / 72


def _step(extent: float) -> float:
    """A round distance between ticks, four to ten to the extent."""
    ten = 10.0 ** np.floor(np.log10(max(extent, 1e-9)))
    return float(next(ten * s for s in (0.1, 0.2, 0.25, 0.5, 1.0, 2.0) if extent / (ten * s) <= 6))


def painted(
    flat: Array,
    solid: Array,
    faces: Index,
    colours: ArrayLike | None = None,
    contrast: float = 0.5,
) -> PolyCollection:
    """A shaded mesh: `flat` (N, 2) is where vertices are drawn, `solid` (N, 3) where they are
    for the viewer (right, up, towards), in one unit. `colours` (F, 3) or one for all.

    Faces with a vertex that is not finite are left out.
    """
    finite = np.asarray(np.isfinite(np.column_stack([flat, solid])).all(axis=1))
    drawn = finite[faces].all(axis=1)
    base = np.broadcast_to(np.asarray(to_rgb(SKIN) if colours is None else colours), faces.shape)
    faces, base = faces[drawn], base[drawn]
    brightness = 1 - contrast + contrast * lightness(solid, faces)
    rgb = np.clip(base * brightness[:, None], 0, 1)
    order = np.argsort(solid[:, 2][faces].sum(axis=1), kind="stable")  # far faces first
    return PolyCollection(
        flat[faces[order]],  # type: ignore[arg-type]  # an array is a sequence of arrays
        facecolors=rgb[order],
        edgecolors=rgb[order],  # hides the seams between neighbours
        linewidths=0.3,
        rasterized=True,
    )


def lightness(solid: Array, faces: Index) -> Array:
    """How much each face is turned to the light, (F,) from 0 to 1, smoothed over its vertices."""
    at_vertices = sums_over_faces(face_vectors(solid, faces), faces, len(solid))
    smooth = at_vertices[faces].sum(axis=1)
    smooth = smooth * np.where(smooth[:, 2:] < 0, -1.0, 1.0)  # both sides of a face are skin
    length = np.linalg.norm(smooth, axis=1)
    towards = smooth @ (LIGHT / np.linalg.norm(LIGHT))
    return np.asarray(np.clip(towards / np.where(length > 0, length, 1.0), 0, 1))
