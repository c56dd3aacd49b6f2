"""The figure of lecture 15 on basins: how far ICP's starts may be turned."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from workbench.errors import BadArgument
from workbench.plots.palette import DASHES, FAINT, LINES, MARKERS
from workbench.registration import BasinMap


def plot_basins(maps: Sequence[BasinMap], *, ax: Axes) -> Axes:
    """The error at the end over the angle of the start, a line for each map of one axis.

    Filled marks are starts that ended at the truth, empty ones ended elsewhere. Raises BadArgument
    for a map of several axes, or for no map.
    """
    if not maps or any(len(one.axes) != 1 for one in maps):
        raise BadArgument("plot_basins takes maps of one axis")
    for k, one in enumerate(maps):
        order = np.argsort(one.angles[:, 0])
        x, y, found = one.angles[order, 0], one.turned[order], one.found[order]
        colour, mark = LINES[k % len(LINES)], MARKERS[k % len(MARKERS)]
        dashes = DASHES[k % len(DASHES)]
        ax.plot(x, y, dashes, color=colour, linewidth=1.2, alpha=0.7)
        size = max(4.0, 10.0 - 2.5 * k)  # so that equal ends of several maps are all seen
        ax.plot(x[found], y[found], mark, color=colour, ms=size, label=f"about {one.axes[0]}")
        ax.plot(x[~found], y[~found], mark, color=colour, ms=size, markerfacecolor="white")
    ax.set(xlim=(-187, 187), ylim=(-6, 186))
    ax.set_xlabel("angle of the start from the truth (degrees)")
    ax.set_ylabel("rotation error at the end (degrees)")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(30))
    ax.grid(color=FAINT, alpha=0.25)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=len(maps))
    return ax


def caption_basins(maps: Sequence[BasinMap]) -> str:
    """What `plot_basins` shows. Raises BadArgument as it does."""
    if not maps or any(len(one.axes) != 1 for one in maps):
        raise BadArgument("caption_basins takes maps of one axis")
    reaches = "; ".join(
        (
            "for no range of angles"
            if np.isnan(one.reach)
            else f"for angles up to {one.reach:g} degrees"
        )
        + f" about {one.axes[0]}"
        for one in maps
    )
    return (
        "Rotation error at the end of a rigid registration, over the angle by which its start was "
        f"turned about one axis. Filled marks ended at the truth, within {1e3 * maps[0].near:.0f} "
        f"mm on average, and empty ones elsewhere. All starts ended at the truth {reaches}."
    )
