"""How far surfaces are from a reference, in colours on the body."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

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
    away = {label: distances_between(vertices, whole) for label, vertices in others.items()}
    end = max(float(d.max()) for d in away.values()) if most is None else most
    shown = [(Figurine(label, others[label], look), away[label]) for label in others]
    first = [Figurine(name, whole, look)]
    return line_up_coloured(shown, faces, end, f"distance from {name} (mm)", ax=ax, before=first)


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
        replace(figurine, colours=np.asarray(scale.to_rgba(away[faces].mean(axis=1)))[:, :3])
        for figurine, away in measured
    ]
    line_up([*before, *coloured], faces, ax=ax, contrast=0.25)
    beyond = max(float(away.max(initial=0.0)) for _, away in measured) > end
    extend = "max" if beyond else "neither"
    figure = ax.get_figure()
    assert figure is not None
    figure.colorbar(scale, ax=ax, shrink=0.85, pad=0.02, extend=extend).set_label(label)
    return ax
