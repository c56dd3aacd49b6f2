"""How far a fitted surface is from the truth, in colours on the body."""

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from workbench.plots.body import Figurine, back, front, line_up
from workbench.plots.palette import AMOUNT

Array = NDArray[np.float64]


def plot_distances(
    vertices: Array, distances: Array, faces: NDArray[np.int64], *, ax: Axes, truth: str = "truth"
) -> Axes:
    """The body (N, 3) m from the front and the back, coloured by `distances` (N,) mm from what
    is called `truth`.
    """
    largest = float(distances.max(initial=0.0))
    scale = Normalize(0.0, largest if largest > 0 else 1.0)
    colours = matplotlib.colormaps[AMOUNT](scale(distances[faces].mean(axis=1)))[:, :3]
    shown = (
        Figurine("front", vertices, front, colours),
        Figurine("back", vertices, back, colours),
    )
    line_up(shown, faces, ax=ax, contrast=0.25)
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(ScalarMappable(scale, AMOUNT), ax=ax, shrink=0.85, pad=0.02)
    bar.set_label(f"distance to the {truth} (mm)")
    return ax


def caption_distances(distances: Array, truth: str = "truth") -> str:
    """What `plot_distances` shows."""
    low, high = np.percentile(distances, [50, 95])
    return (
        f"Distance of every vertex from its place in the {truth}: half within {low:.3g} mm, "
        f"95 % within {high:.3g} mm, the farthest {distances.max():.3g} mm off."
    )
