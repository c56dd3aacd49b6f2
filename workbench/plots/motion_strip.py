"""Frames of a motion side by side, as stick figures or as points."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from workbench.arrays import Array, Index
from workbench.plots.palette import BLUE, FAINT, VERMILLION

MOST = 8  # frames of a strip
MARGIN = 1.1


def plot_motion(places: Array, pairs: Index, fps: float | None, *, ax: Axes) -> Axes:
    """Up to eight frames of points (T, M, 3) m from the front, with lines between pairs (E, 2).

    All frames have the same scale and the same height, and each is moved sideways to its place.
    Under each stands its time, or its number if the rate is not known. Points that are NaN are left
    out.
    """
    chosen = frames_of_strip(len(places))
    flat = places[chosen][:, :, :2]
    lower, upper = np.nanmin(flat, axis=1), np.nanmax(flat, axis=1)
    wide = MARGIN * float(np.nanmax(upper[:, 0] - lower[:, 0])) + 1e-3
    for i, (t, points) in enumerate(zip(chosen, flat, strict=True)):
        at = points - [(lower[i, 0] + upper[i, 0]) / 2 - i * wide, 0.0]
        bones = at[pairs] if len(pairs) else np.zeros((0, 2, 2))
        whole = np.isfinite(bones).all(axis=(1, 2))
        ax.add_collection(LineCollection(list(bones[whole]), colors=BLUE, linewidths=1.4))
        ax.plot(*at.T, ".", color=VERMILLION, markersize=2.5)
        said = f"{t}" if fps is None else f"{t / fps:.2f} s"
        ax.text(
            i * wide, np.nanmin(lower[:, 1]) - 0.06 * wide, said, ha="center", va="top", fontsize=8
        )
    tall = float(np.nanmax(upper[:, 1]) - np.nanmin(lower[:, 1])) + 1e-3
    floor = np.nanmin(lower[:, 1])
    ax.axhline(floor, color=FAINT, linewidth=0.5)
    ax.set(xlim=(-wide / 2, (len(chosen) - 0.5) * wide), aspect="equal", xticks=[])
    ax.set(ylim=(floor - 0.1 * tall - 0.1 * wide, floor + MARGIN * tall), ylabel="height, m")
    ax.grid(False)
    return ax


def caption_motion(frames: int, fps: float | None) -> str:
    """What `plot_motion` shows."""
    shown = len(frames_of_strip(frames))
    rate = "" if fps is None else f" at {fps:g} frames a second"
    return f"{shown} of {frames} frames{rate}, seen from the front."


def frames_of_strip(frames: int) -> list[int]:
    """The frames that are drawn, evenly spread, the first and the last among them."""
    return sorted({int(t) for t in np.linspace(0, frames - 1, min(frames, MOST)).round()})
