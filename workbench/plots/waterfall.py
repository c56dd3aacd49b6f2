"""Multistart: the ends of every solver's runs, sorted, so that basins are steps."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.comparison import Comparison
from workbench.plots.cost_traces import LOWEST
from workbench.plots.decades import decades
from workbench.plots.lettering import plain
from workbench.plots.palette import FAINT
from workbench.plots.solver_lines import line, marker


def plot_waterfall(comparison: Comparison, problem: str, *, ax: Axes) -> Axes:
    """(f - f*) / (f_0 - f*) of the ends on one problem, each solver's sorted, worst last."""
    instances = comparison.of(problem)
    for k, solver in enumerate(comparison.solvers):
        gaps = [t[-1, 2] for i in instances if len(t := comparison.trace(i, solver))]
        y = np.maximum(np.sort(np.array(gaps, dtype=float)), LOWEST)
        x = np.arange(1, len(y) + 1)
        ax.plot(x, y, marker=marker(k), markersize=4, linewidth=1.0, label=plain(solver), **line(k))
    for tau in comparison.taus:
        ax.axhline(tau, color=FAINT, linewidth=0.7, linestyle=(0, (1, 3)))
    ax.set_yscale("log")
    ax.set_ylim(LOWEST / 3, 5)
    decades(ax.yaxis, LOWEST, 1.0)
    ax.set_xlim(0.5, len(instances) + 0.5)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("run, best first")
    ax.set_ylabel("(f − f*) / (f₀ − f*)")
    ax.grid(color=FAINT, alpha=0.2, linewidth=0.6)
    return ax


def caption_waterfall(comparison: Comparison, problem: str) -> str:
    """What `plot_waterfall` shows."""
    runs = len(comparison.of(problem))
    return (
        f"{problem}: how far above the lowest cost known each solver's {runs} "
        "runs got at best, sorted for each solver by itself. Flat steps are basins that were met "
        "several times; the further right a solver's curve stays at the bottom, the more starts "
        "it brings there. Dotted lines are the targets."
    )
