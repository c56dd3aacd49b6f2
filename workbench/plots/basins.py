"""From which starts a rigid registration ends at the truth."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.ticker import MultipleLocator

from workbench.errors import BadArgument
from workbench.plots.palette import AMOUNT, DASHES, FAINT, INK, LINES, MARKERS
from workbench.registration import BasinMap


def plot_basins(maps: Sequence[BasinMap], *, ax: Axes) -> Axes:
    """The error at the end over the angle of the start, a line for each map of one axis.

    Filled marks are starts that ended at the truth, empty ones ended elsewhere. Raises BadArgument
    for a map of several axes, or for no map.
    """
    if not maps or any(len(one.axes) != 1 for one in maps):
        raise BadArgument("plot_basins takes maps of one axis; plot_basin_grid takes one of two")
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
    reaches = "; ".join(f"{_reach(one)} about {one.axes[0]}" for one in maps)
    return (
        "Rotation error at the end of a rigid registration, over the angle by which its start was "
        f"turned about one axis. Filled marks ended at the truth, within {1e3 * maps[0].near:.0f} "
        f"mm on average, and empty ones elsewhere. All starts ended at the truth {reaches}."
    )


def plot_basin_grid(one: BasinMap, *, ax: Axes) -> Axes:
    """The error at the end over the angles of the start about two axes, as colours.

    A cross is a start that did not end at the truth. Raises BadArgument for a map of another number
    of axes.
    """
    x, y, errors = _table(one)
    step = float(x[1] - x[0]) if len(x) > 1 else 1.0
    edges = [np.append(a - step / 2, a[-1] + step / 2) for a in (x, y)]
    image = ax.pcolormesh(*edges, errors.T, cmap=AMOUNT, norm=Normalize(0, 180))
    lost = one.angles[~one.found]
    ax.plot(lost[:, 0], lost[:, 1], "x", color="white", markersize=5, markeredgewidth=1.6)
    ax.plot(lost[:, 0], lost[:, 1], "x", color=INK, markersize=4, markeredgewidth=0.8)
    ax.set_xlabel(f"start turned about {one.axes[0]} (degrees)")
    ax.set_ylabel(f"then about {one.axes[1]} (degrees)")
    ax.set_aspect("equal")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MultipleLocator(60))
    figure = ax.get_figure()
    assert figure is not None
    bar = figure.colorbar(image, ax=ax, shrink=0.85, pad=0.02)
    bar.set_label("rotation error at the end (degrees)")
    bar.locator = MultipleLocator(30)
    bar.update_ticks()
    return ax


def caption_basin_grid(one: BasinMap) -> str:
    """What `plot_basin_grid` shows. Raises BadArgument as it does."""
    _table(one)
    first, second = one.axes
    return (
        "Rotation error at the end of a rigid registration, over the angles by which its start was "
        f"turned about {first} and then about {second}. A cross marks a start that did not end at "
        f"the truth, within {1e3 * one.near:.0f} mm on average; {one.found.sum()} of "
        f"{len(one.found)} starts did."
    )


def _reach(one: BasinMap) -> str:
    if np.isnan(one.reach):
        return "for no range of angles"
    return f"for angles up to {one.reach:g} degrees"


def _table(one: BasinMap) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if len(one.axes) != 2:
        raise BadArgument(f"plot_basin_grid takes a map of two axes, not of {len(one.axes)}")
    x, y = np.unique(one.angles[:, 0]), np.unique(one.angles[:, 1])
    errors = np.full((len(x), len(y)), np.nan)
    at = np.searchsorted(x, one.angles[:, 0]), np.searchsorted(y, one.angles[:, 1])
    errors[at] = one.turned
    return x, y, errors
