"""How the cost came down in every run, against effort and against time."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from workbench.comparison import Comparison
from workbench.comparison.targets import named
from workbench.plots.decades import decades
from workbench.plots.lettering import plain
from workbench.plots.palette import FAINT
from workbench.plots.solver_lines import line

LOWEST = 1e-12  # of the whole way; what is below is drawn there


@dataclass(frozen=True)
class Effort:
    """What the cost is drawn against: a column of `Comparison.trace`."""

    column: int
    label: str
    least: float  # on the axis


UNITS = Effort(0, "effort (evaluations of the residual)", 0.8)
SECONDS = Effort(1, "measured time (s)", 1e-4)


def plot_cost_traces(
    comparison: Comparison, problem: str, *, ax: Axes, against: Effort = UNITS
) -> Axes:
    """(f - f*) / (f_0 - f*) of the best point so far: a line per run, a colour per solver."""
    instances = comparison.of(problem)
    alpha = 0.9 if len(instances) == 1 else max(0.25, 0.8 / len(instances) ** 0.5)
    longest = against.least * 10
    for k, solver in enumerate(comparison.solvers):
        for instance in instances:
            trace = comparison.trace(instance, solver)
            if not len(trace):
                continue
            x = np.maximum(trace[:, against.column], against.least)
            longest = max(longest, float(np.max(x, where=np.isfinite(x), initial=0.0)))
            y = np.maximum(trace[:, 2], LOWEST)
            ax.step(x, y, where="post", linewidth=1.3, alpha=alpha, **line(k))
            ax.plot(x[-1:], y[-1:], ".", color=line(k)["color"], alpha=alpha, markersize=5)
        ax.plot([], [], linewidth=1.6, label=plain(solver), **line(k))
    for tau in comparison.taus:
        ax.axhline(tau, color=FAINT, linewidth=0.7, linestyle=(0, (1, 3)))
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(LOWEST / 3, 5)
    ax.set_xlim(against.least, 1.5 * longest)
    decades(ax.xaxis, against.least, 1.5 * longest)
    decades(ax.yaxis, LOWEST, 1.0)
    ax.set_xlabel(against.label)
    ax.set_ylabel("(f − f*) / (f₀ − f*)")
    ax.grid(color=FAINT, alpha=0.2, linewidth=0.6)
    return ax


def caption_cost_traces(comparison: Comparison, problem: str) -> str:
    """What `plot_cost_traces` shows."""
    instances = comparison.of(problem)
    runs = "one run of each solver" if len(instances) == 1 else f"{len(instances)} runs of each"
    return (
        f"{problem}: how far the best point so far was still above the lowest cost known, as a "
        f"share of the whole way down; {runs}, a dot where a run ended. Dotted lines are the "
        f"targets. What is below {named(LOWEST)} is drawn there. A line that runs flat above "
        "the targets sits in another basin, or is stuck. Effort is counted at fixed prices; "
        "time is as measured, and differs from machine to machine and from run to run."
    )
