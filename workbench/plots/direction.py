"""A direction of the unknowns as a picture: the body moved along it, one way and the other."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from workbench.arrays import Array, Index
from workbench.plots.body import Figurine, front, line_up, side
from workbench.plots.palette import SKIN, VERMILLION


def plot_direction(moved: Mapping[str, Array], faces: Index, *, ax: Axes) -> Axes:
    """Surfaces (N, 3) m by label, the second of three being where the fit is.

    What moves is red, as red as it moves far, on one scale for all; front, then side.
    """
    labels, surfaces = list(moved), list(moved.values())
    here = surfaces[len(surfaces) // 2]
    far = [np.linalg.norm(s - here, axis=1) for s in surfaces]
    most = max(float(d.max()) for d in far) or 1.0
    pale, red = np.array(to_rgb(SKIN)), np.array(to_rgb(VERMILLION))
    centre = here.mean(axis=0)
    figurines = []
    for look, word in ((front, ""), (side, ", side")):
        for label, surface, d in zip(labels, surfaces, far, strict=True):
            share = (d / most)[faces].mean(axis=1)[:, None]
            colours = pale + share * (red - pale)
            figurines.append(Figurine(label + word, surface - centre, look, colours))
    line_up(figurines, faces, ax=ax)
    ax.tick_params(axis="x", labelsize=8)
    return ax


def caption_direction(name: str, moved: Mapping[str, Array], amount: float, unit: str) -> str:
    """What `plot_direction` shows."""
    surfaces = list(moved.values())
    here = surfaces[len(surfaces) // 2]
    most = max(float(np.linalg.norm(s - here, axis=1).max()) for s in surfaces)
    return (
        f"{name}: the body moved {amount:.3g} {unit} along it, both ways. The reddest "
        f"point moves {100 * most:.3g} cm."
    )
