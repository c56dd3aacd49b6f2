"""Where several starts of one solver end: costs, sorted, so that each minimum is a step."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.errors import BadArgument
from workbench.plots.palette import LINES
from workbench.solvers import Hypothesis, Solution
from workbench.solvers.starts import further_minima

LEAST = 1e-12  # of the largest cost; lower costs are drawn there


def plot_minima(solution: Solution, *, ax: Axes) -> Axes:
    """The cost of the minimum to which each start led, the lowest first: `Starts` found them.

    Ends without a finite cost keep their places, which stay empty. Raises BadArgument for the
    solution of a single start.
    """
    minima = _minima(solution)
    largest = max((one.cost for one in minima if np.isfinite(one.cost)), default=0.0) or 1.0
    first = 1
    for k, one in enumerate(minima):
        last = first + len(one.starts)
        if np.isfinite(one.cost):
            x = np.arange(first, last)
            y = np.full(len(x), max(one.cost, LEAST * largest))
            ax.plot(x, y, "o-", color=LINES[k % len(LINES)], markersize=5, linewidth=1.4)
        first = last
    ax.set(yscale="log", xlim=(0.5, first - 0.5))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set(xlabel="start, the one with the lowest end first", ylabel="cost at the end")
    return ax


def caption_minima(solution: Solution) -> str:
    """What `plot_minima` shows. Raises BadArgument for the solution of a single start."""
    minima = _minima(solution)
    starts, here = sum(len(one.starts) for one in minima), len(minima[0].starts)
    lost = sum(len(one.starts) for one in minima if not np.isfinite(one.cost))
    failed = f"{lost} of the runs ended without a finite cost and {'is' if lost == 1 else 'are'} "
    return (
        f"The cost at the end of {starts} runs, one from each start, sorted. Each step of one "
        f"colour is a minimum, as wide as the number of starts that led to it: there are "
        f"{len(minima)}, and {here} of the {starts} starts led to the lowest. "
        + (f"{failed}not drawn. " if lost else "")
        + f"{further_minima(starts, len(minima)).capitalize()}."
    )


def _minima(solution: Solution) -> tuple[Hypothesis, ...]:
    if not solution.hypotheses:
        raise BadArgument(
            f"the solution of {solution.solver} holds no minima of several starts; solve with "
            "`Starts`, such as Starts(20, solver)"
        )
    return solution.hypotheses
