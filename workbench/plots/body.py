"""Bodies side by side, distances on them, directions, capsules and torn triangles."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.fitting.setup import distances as distances_between
from workbench.geometry.solids import face_vectors, sums_over_faces
from workbench.plots.palette import AMOUNT, FAINT, SKIN
from workbench.plots.style import height_to_scale, house_style, plain, to_scale

LABEL_WIDTH = 10  # of a line of a label: what is longer goes on more lines
Look = Callable[[Array], Array]  # vertices (N, 3) m -> right, up, towards the viewer (N, 3) m
# right, up, towards: from the upper left, behind the viewer
LIGHT_DIRECTION = np.array([-0.35, 0.55, 0.76])


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
    """One drawing of a body in a line-up."""

    label: str  # the text below it
    vertices: Array  # (N, 3) in metres
    look: Look = front  # from which side it is drawn
    # (F, 3) for the faces, or one colour for all; None for the colour of skin
    colours: ArrayLike | None = None
    faces: Index | None = None  # (F, 3) its own faces, where they are not those of the others


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
    shapes: Mapping[str, Array], ends: str = "two", drawn: str = "Each shape direction shown"
) -> str:
    """What `plot_shape_gallery` shows: the directions `drawn`, at `ends` standard deviations."""
    heights = {name: float(np.ptp(v[:, 1])) for name, v in shapes.items()}
    low, high = min(heights, key=heights.__getitem__), max(heights, key=heights.__getitem__)
    return (
        f"{drawn} alone, at plus and minus {ends} standard deviations. The "
        f"tallest body, {high}, is {heights[high]:.2f} m tall, and the shortest, {low}, "
        f"{heights[low]:.2f} m."
    )


def line_up(
    figurines: tuple[Figurine, ...] | list[Figurine],
    faces: Index,
    *,
    ax: Axes,
    contrast: float = 0.5,
) -> Axes:
    """Draw bodies from left to right, named below, heights in metres on one scale."""
    solids = [f.look(f.vertices) for f in figurines]
    gap = 0.12 * max(float(np.ptp(s[:, 1])) for s in solids)
    extents = [float(np.ptp(s[:, 0])) for s in solids]
    labels = [fill(plain(f.label), LABEL_WIDTH, break_long_words=False) for f in figurines]
    x, places = 0.0, []
    for figurine, solid, extent in zip(figurines, solids, extents, strict=True):
        flat = solid[:, :2] + [x - float(solid[:, 0].min()), 0.0]
        own = faces if figurine.faces is None else figurine.faces
        ax.add_collection(painted(flat, solid, own, figurine.colours, contrast))
        places.append(x + extent / 2)
        x += extent + gap
    low = min(float(s[:, 1].min()) for s in solids)
    high = max(float(s[:, 1].max()) for s in solids)
    ax.set(xlim=(-gap, x), ylim=(low - gap / 2, high + gap / 2))
    ax.set_aspect("equal")
    ax.set_xticks(places, labels)
    ax.tick_params(axis="x", length=0, labelsize=8)
    ax.yaxis.set_major_locator(MultipleLocator(_step(high - low)))
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(ylabel="y (m)")
    ax.spines["bottom"].set_visible(False)
    return ax


def _step(extent: float) -> float:
    """A round distance between ticks, four to ten to the extent."""
    ten = 10.0 ** np.floor(np.log10(max(extent, 1e-9)))
    return float(next(ten * s for s in (0.1, 0.2, 0.25, 0.5, 1.0, 2.0) if extent / (ten * s) <= 6))


def painted(
    flat: Array, solid: Array, faces: Index, colours: ArrayLike | None = None, contrast: float = 0.5
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
    towards = smooth @ (LIGHT_DIRECTION / np.linalg.norm(LIGHT_DIRECTION))
    return np.asarray(np.clip(towards / np.where(length > 0, length, 1.0), 0, 1))


def body_sheet(vertices: Array, faces: Index) -> Figure:
    """A body from the front and from the side."""
    return to_scale(partial(plot_body, vertices, faces), 5.6)


def shape_gallery_sheet(shapes: Mapping[str, Array], faces: Index) -> Figure:
    """Shapes in two rows on one scale."""
    half = (len(shapes) + 1) // 2
    rows = [dict(islice(shapes.items(), half)), dict(islice(shapes.items(), half, None))]
    rows = [row for row in rows if row]
    with house_style():
        figure = Figure(figsize=(8.0, 5.8), layout="constrained")
        axes = list(figure.subplots(len(rows), 1, squeeze=False)[:, 0])
        for ax, row in zip(axes, rows, strict=True):
            plot_shape_gallery(row, faces, ax=ax)
            ax.set_xlabel("")
        widest = max(ax.get_xlim()[1] - ax.get_xlim()[0] for ax in axes)
        low, high = (pick(ax.get_ylim()[i] for ax in axes) for i, pick in ((0, min), (1, max)))
        for ax in axes:  # one scale for both
            middle = sum(ax.get_xlim()) / 2
            ax.set(xlim=(middle - widest / 2, middle + widest / 2), ylim=(low, high))
        figure.set_figheight(sum(height_to_scale(ax, 7.2) for ax in axes))
    return figure


def plot_distances(
    vertices: Array, distances: Array, faces: Index, *, ax: Axes, truth: str = "truth"
) -> Axes:
    """A body (N, 3) m from the front and the back, coloured by `distances` (N,) mm from what
    is called `truth`.
    """
    looks = {"front": front, "back": back}
    shown = [(Figurine(name, vertices, look), distances) for name, look in looks.items()]
    end = float(distances.max(initial=0.0))
    return line_up_coloured(shown, faces, end, f"distance to the {truth} (mm)", ax=ax)


def caption_distances(distances: Array, truth: str = "truth") -> str:
    """What `plot_distances` shows."""
    low, high = np.percentile(distances, [50, 95])
    return (
        f"Distance of every vertex from its place in the {truth}: half of them are within "
        f"{low:.3g} mm and 95 % within {high:.3g} mm; the farthest is {distances.max():.3g} mm off."
    )


def plot_differences(
    whole: Array,
    others: Mapping[str, Array],
    faces: Index,
    *,
    ax: Axes,
    look: Look = front,
    name: str = "SMPL",
    most: float | None = None,
) -> Axes:
    """Draw `whole` (N, 3) m uncoloured, and then the others, coloured by distance from it in mm.

    `whole` is called `name`. The scale of colours ends at `most` mm, or at the largest distance;
    larger distances have the last colour.
    """
    distances = {label: distances_between(vertices, whole) for label, vertices in others.items()}
    end = max(float(d.max()) for d in distances.values()) if most is None else most
    shown = [(Figurine(label, others[label], look), distances[label]) for label in others]
    first = [Figurine(name, whole, look)]
    return line_up_coloured(shown, faces, end, f"distance from {name} (mm)", ax=ax, before=first)


def caption_differences(whole: Array, others: Mapping[str, Array], name: str = "SMPL") -> str:
    """What `plot_differences` shows."""
    distances = {label: distances_between(vertices, whole) for label, vertices in others.items()}
    listed = "; ".join(
        f"{label} {d.mean():.1f} mm on average, at most {d.max():.0f} mm"
        for label, d in distances.items()
    )
    return (
        "All bodies have one pose and are seen by one camera. Colours show how far a vertex is "
        f"from {name}'s: {listed}."
    )


def line_up_coloured(
    measured: Sequence[tuple[Figurine, Array]],
    faces: Index,
    end: float,
    label: str,
    *,
    ax: Axes,
    before: Sequence[Figurine] = (),
) -> Axes:
    """Bodies side by side, coloured by the distances (N,) in mm beside each, and the colour bar.

    Colours go from 0 to `end` mm, and a face has that of the mean distance of its corners. The
    bodies in `before` stand to the left of the others and keep the colours that they have.
    """
    scale = ScalarMappable(Normalize(0.0, end if end > 0 else 1.0), AMOUNT)
    coloured = [
        replace(figurine, colours=np.asarray(scale.to_rgba(distances[faces].mean(axis=1)))[:, :3])
        for figurine, distances in measured
    ]
    line_up([*before, *coloured], faces, ax=ax, contrast=0.25)
    beyond = max(float(distances.max(initial=0.0)) for _, distances in measured) > end
    extend = "max" if beyond else "neither"
    figure = ax.get_figure()
    assert figure is not None
    figure.colorbar(scale, ax=ax, shrink=0.85, pad=0.02, extend=extend).set_label(label)
    return ax


def distances_sheet(
    vertices: Array, distances: Array, faces: Index, truth: str = "truth"
) -> Figure:
    """A body from the front and the back, coloured by distances in mm."""
    plot = partial(plot_distances, vertices, distances, faces, truth=truth)
    return to_scale(plot, 4.8, 6.2)


def plot_stitching(stages: Mapping[str, Array], *, ax: Axes) -> Axes:
    """Draw several stages side by side: `stages` maps their names to triangles (F, 3, 3) m."""
    triangles = np.arange(3 * len(next(iter(stages.values())))).reshape(-1, 3)
    shown = [Figurine(name, corners.reshape(-1, 3)) for name, corners in stages.items()]
    return line_up(shown, triangles, ax=ax, contrast=0.7)
