"""How the cost came down in every run, against effort and against time."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.comparison import Comparison
from workbench.comparison.targets import named
from workbench.plots.palette import FAINT, solver_styles
from workbench.plots.style import decades, plain

LOWEST = 1e-12  # of the way from the start to the lowest cost; smaller values are drawn there


@dataclass(frozen=True)
class TraceColumn:
    """A column of `Comparison.trace` against which the cost is drawn.

    Attributes:
        column: its index.
        label: of the axis.
        least: the smallest number on the axis.
    """

    column: int
    label: str
    least: float


UNITS = TraceColumn(0, "effort (evaluations of the residual)", 0.8)
SECONDS = TraceColumn(1, "measured time (s)", 1e-4)


def plot_cost_traces(
    comparison: Comparison, problem: str, *, ax: Axes, against: TraceColumn = UNITS
) -> Axes:
    """(f - f*) / (f_0 - f*) of the best point so far: a line per run, a colour per solver."""
    instances = comparison.of(problem)
    alpha = 0.9 if len(instances) == 1 else max(0.25, 0.8 / len(instances) ** 0.5)
    longest = against.least * 10
    for solver, style in solver_styles(comparison.solvers).items():
        for instance in instances:
            trace = comparison.trace(instance, solver)
            if not len(trace):
                continue
            x = np.maximum(trace[:, against.column], against.least)
            longest = max(longest, float(np.max(x, where=np.isfinite(x), initial=0.0)))
            y = np.maximum(trace[:, 2], LOWEST)
            ax.step(x, y, where="post", linewidth=1.3, alpha=alpha, **style.line)
            ax.plot(x[-1:], y[-1:], ".", color=style.color, alpha=alpha, markersize=5)
        ax.plot([], [], linewidth=1.6, label=plain(solver), **style.line)
    relative_cost_axis(comparison, ax)
    ax.set(xscale="log", xlim=(against.least, 1.5 * longest), xlabel=against.label)
    decades(ax.xaxis, against.least, 1.5 * longest)
    return ax


def relative_cost_axis(comparison: Comparison, ax: Axes) -> None:
    """Label the y-axis with (f - f*) / (f_0 - f*), and mark the targets on it."""
    for tau in comparison.taus:
        ax.axhline(tau, color=FAINT, linewidth=0.7, linestyle=(0, (1, 3)))
    ax.set(yscale="log", ylim=(LOWEST / 3, 5), ylabel="(f − f*) / (f₀ − f*)")
    decades(ax.yaxis, LOWEST, 1.0)
    ax.grid(color=FAINT, alpha=0.2, linewidth=0.6)


def caption_cost_traces(comparison: Comparison, problem: str) -> str:
    """What `plot_cost_traces` shows."""
    instances = comparison.of(problem)
    runs = "one run of each solver" if len(instances) == 1 else f"{len(instances)} runs of each"
    return (
        f"{problem}: how far the best point so far was above the lowest known cost, as a share of "
        f"the difference between that and the cost at the start; {runs}, with a dot where a run "
        "ended. Dotted lines are the targets. Values below "
        f"{named(LOWEST)} are drawn there. A line that stays flat above the targets is in another "
        "basin, or stuck. Effort is counted at fixed prices; time is measured, and differs from "
        "machine to machine and from run to run."
    )


def plot_waterfall(comparison: Comparison, problem: str, *, ax: Axes) -> Axes:
    """(f - f*) / (f_0 - f*) at the ends on one problem, sorted for each solver, the worst last."""
    instances = comparison.of(problem)
    for solver, style in solver_styles(comparison.solvers).items():
        gaps = [t[-1, 2] for i in instances if len(t := comparison.trace(i, solver))]
        y = np.maximum(np.sort(np.array(gaps, dtype=float)), LOWEST)
        x = np.arange(1, len(y) + 1)
        ax.plot(
            x,
            y,
            marker=style.marker,
            markersize=4,
            linewidth=1.0,
            label=plain(solver),
            **style.line,
        )
    relative_cost_axis(comparison, ax)
    ax.set(xlim=(0.5, len(instances) + 0.5), xlabel="run, best first")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def caption_waterfall(comparison: Comparison, problem: str) -> str:
    """What `plot_waterfall` shows."""
    runs = len(comparison.of(problem))
    return (
        f"{problem}: how far above the lowest cost known each solver's {runs} "
        "runs got at best, sorted for each solver separately. Flat steps are basins that several "
        "runs ended in; the further right a solver's curve stays at the bottom, the more of its "
        "runs end there. Dotted lines are the targets."
    )
