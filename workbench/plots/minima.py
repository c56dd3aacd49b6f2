"""Where several starts of one solver end: costs, sorted, so that each minimum is a step."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from workbench.plots.palette import LINES
from workbench.solvers import Solution
from workbench.solvers.minima import all_seen

LEAST = 1e-12  # of the largest cost; lower costs are drawn there


def plot_minima(solution: Solution, *, ax: Axes) -> Axes:
    """The cost of the minimum to which each start led, the lowest first: `Starts` found them."""
    costs = np.array([one.cost for one in solution.hypotheses])
    finite = costs[np.isfinite(costs)]
    largest = float(np.max(finite, initial=0.0)) or 1.0
    first = 1
    for k, one in enumerate(solution.hypotheses):
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
    """What `plot_minima` shows."""
    minima = solution.hypotheses
    starts, here = sum(len(one.starts) for one in minima), len(minima[0].starts)
    text = (
        f"The cost at the end of {starts} runs, one from each start, sorted. Each step of one "
        f"colour is a minimum, as wide as the number of starts that led to it: there are "
        f"{len(minima)}, and {here} of the {starts} starts led to the lowest. "
    )
    sure = all_seen(starts, len(minima))
    if not np.isfinite(sure):
        return text + "These are too few starts to say whether there are further minima."
    return text + f"The probability that there are no further minima is {sure:.2g}."
