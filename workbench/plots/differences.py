"""Bodies side by side by one camera, each coloured by its distance from a first one, in mm."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from workbench.plots.body import Figurine, Look, front, line_up
from workbench.plots.palette import AMOUNT

Array = NDArray[np.float64]


def plot_differences(
    whole: Array,
    others: Mapping[str, Array],
    faces: NDArray[np.int64],
    *,
    ax: Axes,
    look: Look = front,
    name: str = "SMPL",
    most: float | None = None,
) -> Axes:
    """`whole` (N, 3) m uncoloured, called `name`, then the others by name, on one scale of mm.

    The scale ends at `most` mm, or at the largest distance; what is farther has the last colour.
    """
    away = {label: distances(v, whole) for label, v in others.items()}
    largest = max(float(d.max()) for d in away.values())
    end = largest if most is None else most
    scale = Normalize(0.0, end if end > 0 else 1.0)
    shown = [Figurine(name, whole, look)]
    for label, vertices in others.items():
        colours = matplotlib.colormaps[AMOUNT](scale(away[label][faces].mean(axis=1)))[:, :3]
        shown.append(Figurine(label, vertices, look, colours))
    line_up(shown, faces, ax=ax, contrast=0.3)
    figure = ax.get_figure()
    assert figure is not None
    beyond = "max" if largest > end else "neither"
    drawn = ScalarMappable(scale, AMOUNT)
    bar = figure.colorbar(drawn, ax=ax, shrink=0.85, pad=0.02, extend=beyond)
    bar.set_label(f"distance from {name} (mm)")
    return ax


def caption_differences(whole: Array, others: Mapping[str, Array], name: str = "SMPL") -> str:
    """What `plot_differences` shows."""
    away = {label: distances(v, whole) for label, v in others.items()}
    said = "; ".join(
        f"{label} {d.mean():.1f} mm on average, at most {d.max():.0f} mm"
        for label, d in away.items()
    )
    return f"One pose, one camera. Colours say how far a vertex is from {name}'s: {said}."


def distances(vertices: Array, whole: Array) -> Array:
    """Of each vertex, (N,) mm."""
    return np.asarray(1e3 * np.linalg.norm(vertices - whole, axis=1))
