"""Multistart: the ends of every solver's runs, sorted, so that basins are steps."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.comparison import Comparison
from workbench.plots.cost_traces import LOWEST, relative_cost_axis
from workbench.plots.labels import plain
from workbench.plots.palette import solver_line, solver_mark


def plot_waterfall(comparison: Comparison, problem: str, *, ax: Axes) -> Axes:
    """(f - f*) / (f_0 - f*) at the ends on one problem, sorted for each solver, the worst last."""
    instances = comparison.of(problem)
    for k, solver in enumerate(comparison.solvers):
        gaps = [t[-1, 2] for i in instances if len(t := comparison.trace(i, solver))]
        y = np.maximum(np.sort(np.array(gaps, dtype=float)), LOWEST)
        x = np.arange(1, len(y) + 1)
        ax.plot(
            x,
            y,
            marker=solver_mark(k),
            markersize=4,
            linewidth=1.0,
            label=plain(solver),
            **solver_line(k),
        )
    relative_cost_axis(comparison, ax)
    ax.set_xlim(0.5, len(instances) + 0.5)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("run, best first")
    return ax


def caption_waterfall(comparison: Comparison, problem: str) -> str:
    """What `plot_waterfall` shows."""
    runs = len(comparison.of(problem))
    return (
        f"{problem}: how far above the lowest cost known each solver's {runs} "
        "runs got at best, sorted for each solver separately. Flat steps are basins that several "
        "runs ended in; the further right a solver's curve stays at the bottom, the more starts "
        "it leads there. Dotted lines are the targets."
    )
