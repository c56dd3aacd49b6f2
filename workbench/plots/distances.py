"""How far surfaces are from a reference, in colours on the body."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from workbench.arrays import Array, Index
from workbench.fitting.setup import distances as distances_between
from workbench.plots.body import Figurine, Look, back, front, line_up
from workbench.plots.palette import AMOUNT


def plot_distances(
    vertices: Array, distances: Array, faces: Index, *, ax: Axes, truth: str = "truth"
) -> Axes:
    """A body (N, 3) m from the front and the back, coloured by `distances` (N,) mm from what
    is called `truth`.
    """
    scale = _scale(float(distances.max(initial=0.0)))
    colours = _colours(scale, distances, faces)
    shown = (
        Figurine("front", vertices, front, colours),
        Figurine("back", vertices, back, colours),
    )
    line_up(shown, faces, ax=ax, contrast=0.25)
    _bar(ax, scale, f"distance to the {truth} (mm)")
    return ax


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
    """`whole` (N, 3) m uncoloured, called `name`, then the others by name, on one scale of mm.

    The scale ends at `most` mm, or at the largest distance; larger ones have the last colour.
    """
    away = {label: distances_between(vertices, whole) for label, vertices in others.items()}
    largest = max(float(d.max()) for d in away.values())
    end = largest if most is None else most
    scale = _scale(end)
    coloured = [
        Figurine(label, vertices, look, _colours(scale, away[label], faces))
        for label, vertices in others.items()
    ]
    line_up([Figurine(name, whole, look), *coloured], faces, ax=ax, contrast=0.3)
    _bar(ax, scale, f"distance from {name} (mm)", "max" if largest > end else "neither")
    return ax


def caption_differences(whole: Array, others: Mapping[str, Array], name: str = "SMPL") -> str:
    """What `plot_differences` shows."""
    away = {label: distances_between(vertices, whole) for label, vertices in others.items()}
    listed = "; ".join(
        f"{label} {d.mean():.1f} mm on average, at most {d.max():.0f} mm"
        for label, d in away.items()
    )
    return (
        "All bodies have one pose and are seen by one camera. Colours show how far a vertex is "
        f"from {name}'s: {listed}."
    )


def _scale(end: float) -> ScalarMappable:
    """Colours from 0 to `end` mm."""
    return ScalarMappable(Normalize(0.0, end if end > 0 else 1.0), AMOUNT)


def _colours(scale: ScalarMappable, distances: Array, faces: Index) -> Array:
    """The colour (F, 3) of each face by the mean distance of its corners."""
    return np.asarray(scale.to_rgba(distances[faces].mean(axis=1)))[:, :3]


def _bar(ax: Axes, scale: ScalarMappable, label: str, extend: str = "neither") -> None:
    figure = ax.get_figure()
    assert figure is not None
    figure.colorbar(scale, ax=ax, shrink=0.85, pad=0.02, extend=extend).set_label(label)
