"""Silhouettes of several bodies over each other, and the outline of one."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from scipy.ndimage import binary_closing

from workbench.arrays import Array, Index, Mask
from workbench.plots.palette import BLUE, VERMILLION

FINE = 420  # dots along the longer side
DENSEST = 24  # points along a face's side
SHADES = LinearSegmentedColormap.from_list("covered", ["#ffffff", BLUE])


def silhouette(flat: Array, faces: Index, low: Array, dot: float, shape: tuple[int, int]) -> Mask:
    """The pixels (rows, columns) that a drawn mesh covers, `low` being the lower left corner.

    `flat` (N, 2) holds the drawn vertices, and `dot` is the size of a pixel in their unit. Every
    face is sampled at points one pixel apart; gaps of one pixel are closed.
    """
    corners = ((flat - low) / dot)[faces]  # (F, 3, 2): column, row
    corners = corners[np.isfinite(corners).all(axis=(1, 2))]
    longest = np.ptp(corners, axis=1).max(initial=0.0)
    n = int(np.clip(np.ceil(longest), 2, DENSEST))
    i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
    weights = np.column_stack([i, j, n - i - j])[i + j <= n] / n
    places = np.floor(np.einsum("pc,fcd->fpd", weights, corners)).reshape(-1, 2)
    inside = ((places >= 0) & (places < [shape[1], shape[0]])).all(axis=1)
    column, row = places[inside].astype(np.int64).T
    covered = np.zeros(shape, dtype=bool)
    covered[row, column] = True
    return np.asarray(binary_closing(np.pad(covered, 2), np.ones((3, 3), dtype=bool))[2:-2, 2:-2])


def draw_silhouettes(flats: Array, faces: Index, low: Array, high: Array, *, ax: Axes) -> None:
    """The share of drawn meshes (M, N, 2) that covers each pixel: white for none, blue for all."""
    dot, columns, rows = _grid(low, high)
    share = np.zeros((rows, columns))
    for flat in flats:
        share += silhouette(flat, faces, low, dot, (rows, columns))
    ends = low + dot * np.array([columns, rows])
    ax.imshow(
        share / len(flats),
        cmap=SHADES,
        vmin=0,
        vmax=1,
        origin="lower",
        interpolation="nearest",
        extent=(low[0], ends[0], low[1], ends[1]),
        zorder=0.5,
    )


def draw_outline(flat: Array, faces: Index, low: Array, high: Array, *, ax: Axes) -> None:
    """The outline of one drawn mesh (N, 2)."""
    dot, columns, rows = _grid(low, high)
    covered = silhouette(flat, faces, low, dot, (rows, columns))
    if covered.any() and not covered.all():
        across, up = (low[i] + dot * (np.arange(n) + 0.5) for i, n in enumerate((columns, rows)))
        ax.contour(
            across,
            up,
            covered.astype(float),
            levels=[0.5],
            colors=VERMILLION,
            linewidths=1.0,
            zorder=0.6,
        )


def _grid(low: Array, high: Array) -> tuple[float, int, int]:
    """The size of a pixel, and how many columns and rows of them there are."""
    dot = float((high - low).max()) / FINE
    columns, rows = (int(n) for n in np.ceil((high - low) / dot))
    return dot, columns, rows
