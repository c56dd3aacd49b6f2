"""Triangles before they are stitched, and the surface that they become."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from workbench.arrays import Array
from workbench.plots.body import Figurine, line_up


def plot_stitching(stages: Mapping[str, Array], *, ax: Axes) -> Axes:
    """Draw several stages side by side: `stages` maps their names to triangles (F, 3, 3) m."""
    triangles = np.arange(3 * len(next(iter(stages.values())))).reshape(-1, 3)
    shown = [Figurine(name, corners.reshape(-1, 3)) for name, corners in stages.items()]
    return line_up(shown, triangles, ax=ax, contrast=0.7)


def caption_stitching(torn: Array, stitched: Array) -> str:
    """What `plot_stitching` shows, of the last two stages (F, 3, 3) m."""
    wanted, got = (corners[:, 1:] - corners[:, :1] for corners in (torn, stitched))
    apart = 1e3 * np.linalg.norm(wanted - got, axis=-1)
    return (
        "Every triangle is deformed by itself, about its own centre, and does not meet its "
        "neighbours; stitching finds the vertices whose edges are nearest to those of the torn "
        f"triangles. Edges differ by {apart.mean():.1f} mm on average, and by at most "
        f"{apart.max():.0f} mm, where one part meets another."
    )
