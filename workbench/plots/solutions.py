"""How solvers converged, and the minima that they found."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.experiments.relative_costs import (
    SMALLEST,
    as_good,
    best_cost,
    ending_in_words,
    share_left,
    start_cost,
)
from workbench.plots.palette import FAINT, LINES, solver_styles
from workbench.plots.style import note_at, plain, side_by_side
from workbench.solvers import Hypothesis, Iterate, Solution
from workbench.solvers.starts import further_minima

TWO_DECADES = 100.0  # an axis of less has ticks at 1, 2 and 5, a longer one at powers of ten


@dataclass(frozen=True)
class Abscissa:
    """What the cost is drawn against.

    Attributes:
        label: of the axis.
        of: its number for an iterate and the index of that.
        scale: sets the axis up, given its largest number.
    """

    label: str
    of: Callable[[int, Iterate], float]
    scale: Callable[[Axes, float], None]


def _count(ax: Axes, longest: float) -> None:
    if longest > 60:
        ax.set_xscale("symlog", linthresh=10)
        ax.xaxis.set_minor_locator(LogLocator(subs=(2, 4, 6, 8)))
        ax.set_xlim(0, 1.5 * longest)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlim(-0.04 * max(longest, 1), 1.04 * max(longest, 1))


def _logarithmic(ax: Axes, longest: float) -> None:
    ax.set_xscale("log")
    if longest <= 0:  # nothing to draw: the axis cannot find limits of its own
        ax.set_xlim(0.1, 1.0)
    low, high = ax.get_xlim()
    ax.xaxis.set_minor_formatter(NullFormatter())  # its labels would run into each other
    if high / low < TWO_DECADES:
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds:g}"))


ITERATIONS = Abscissa("iteration", lambda i, iterate: float(i), _count)
SECONDS = Abscissa("time (s)", lambda i, iterate: max(iterate.seconds, 1e-4), _logarithmic)


def plot_convergence(
    solutions: Mapping[str, Solution], *, ax: Axes, against: Abscissa = ITERATIONS
) -> Axes:
    """(cost - best) / (cost at the start - best) of every iterate, one line per solver.

    `best` is the lowest cost that any of them found; what equals it is drawn on a floor, since
    the axis is logarithmic. A hollow end means that the solver did not converge.
    """
    gaps = {name: gap(solution, solutions) for name, solution in solutions.items()}
    floor = _floor(gaps)
    longest, styles, lowest = 0.0, solver_styles(solutions), as_good(solutions)
    for name, solution in solutions.items():
        iterates = [
            (against.of(i, iterate), above)
            for i, (iterate, above) in enumerate(zip(solution.trace, gaps[name], strict=True))
            if np.isfinite(above)
        ]
        x, y = np.array(iterates).reshape(-1, 2).T
        longest = max(longest, float(x.max(initial=0.0)))
        style, ending = styles[name], ending_in_words(solution.status, name not in lowest)
        ax.plot(
            x,
            np.maximum(y, floor),
            linewidth=1.5,
            marker=style.marker,
            markersize=4,
            markevery=max(1, len(x) // 12),
            label=plain(f"{name}: {ending}"),
            **style.line,
        )
        fill = style.color if solution.converged else "white"
        ax.plot(x[-1:], np.maximum(y[-1:], floor), style.marker, color=style.color, ms=8, mfc=fill)
    ax.set(yscale="log", ylim=(floor / 100, 5.0))
    ticks = [float(t) for t in ax.get_yticks() if 5 * floor < t <= 1]  # the floor stands for 0
    ax.set_yticks(ticks)
    ax.yaxis.set_minor_locator(NullLocator())
    ax.axhline(floor, color=FAINT, linewidth=0.8, linestyle=(0, (1, 2)))
    against.scale(ax, longest)
    note_at(ax, "0: the lowest cost found", 0.01, floor, FAINT, above=-4.0)
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(xlabel=against.label, ylabel="(cost − best) / (start − best)")
    ax.legend(loc="upper right")
    return ax


def caption_convergence(solutions: Mapping[str, Solution]) -> str:
    """What `plot_convergence` shows."""
    best = best_cost(solutions)
    if not np.isfinite(best):
        return "No solver found a point of finite cost."
    same = as_good(solutions)
    text = (
        f"How far the cost was above the lowest one found here, {best:.6g}, as a share of the "
        "difference between that and the cost at the start."
    )
    if len(solutions) > 1:
        took = [solutions[name].seconds for name in same]
        spread = f"{min(took):.2f} to {max(took):.2f} s" if len(took) > 1 else f"{took[0]:.2f} s"
        text += (
            f" {len(same)} of {len(solutions)} solvers end within one millionth of it, after "
            f"{spread} as measured; times differ from run to run."
        )
    if not all(solution.converged for solution in solutions.values()):
        text += " A hollow last mark means that the solver did not converge."
    return text


def gap(solution: Solution, among: Mapping[str, Solution]) -> Array:
    """What is drawn: (cost - best) / (start - best) of each iterate; 0 where nothing was lost."""
    return share_left([i.cost for i in solution.trace], best_cost(among), start_cost(among))


def _floor(gaps: Mapping[str, Array]) -> float:
    every = np.concatenate([*gaps.values(), np.ones(1)])
    above = every[np.isfinite(every) & (every > SMALLEST)]
    return float(max(SMALLEST, 10.0 ** np.floor(np.log10(above.min()) - 0.5)))


def convergence_sheet(solutions: Mapping[str, Solution]) -> Figure:
    """Convergence against iterations and against time, with one legend."""
    plots = [partial(plot_convergence, solutions, against=a) for a in (ITERATIONS, SECONDS)]
    return side_by_side(plots, 8.0, 3.7 + 0.2 * ((len(solutions) + 1) // 2), columns=2)


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
