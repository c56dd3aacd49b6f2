"""The cost of a training, block by block."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from workbench.plots.palette import FAINT, LINES, MARKERS
from workbench.training.execution import LogEntry

NOTHING = 1e-6  # of the last cost: a term below is rounding, and not drawn


def plot_costs(log: Sequence[LogEntry], *, ax: Axes) -> Axes:
    """The cost after every block, the whole and by the terms of the log."""
    at = np.arange(len(log) + 1)
    least = NOTHING * sum(log[-1].after.values())
    for i, term in enumerate(log[0].before):
        costs = [log[0].before[term], *(entry.after[term] for entry in log)]
        if max(costs) > least:
            shown = np.where(np.array(costs) > least, costs, np.nan)
            ax.plot(at, shown, color=LINES[i + 1], marker=MARKERS[i + 1], markersize=4, label=term)
    total = [sum(log[0].before.values()), *(sum(entry.after.values()) for entry in log)]
    ax.plot(at, total, color=LINES[0], marker=MARKERS[0], markersize=5, linewidth=2, label="all")
    ax.set_yscale("log")
    ax.set_xticks(at, ["start", *(entry.block for entry in log)], rotation=60, ha="right")
    ax.set_ylabel("cost (half a sum of squares in sigmas)")
    ax.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
    ax.legend(ncols=2)
    return ax


def caption_costs(log: Sequence[LogEntry]) -> str:
    """The caption of `plot_costs`."""
    totals = [sum(log[0].before.values()), *(sum(entry.after.values()) for entry in log)]
    fell = sum(b < a for a, b in pairwise(totals))
    where = "every block" if fell == len(log) else f"{fell} of {len(log)} blocks"
    return (
        f"The cost falls in {where}, and goes from {totals[0]:.4g} to {totals[-1]:.4g}. Single "
        "terms may rise where others fall by more: templates may leave symmetry for the data."
    )
