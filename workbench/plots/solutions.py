"""How solvers converged, and the minima that they found."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from workbench.arrays import Array
from workbench.experiments.running import (
    COST_ROUNDING,
    as_good,
    best_cost,
    ending_in_words,
    share_left,
    start_cost,
)
from workbench.plots.palette import FAINT, solver_styles
from workbench.plots.style import decades, note_at, plain, side_by_side
from workbench.solvers import Solution


def _iterations(ax: Axes, longest: float) -> None:
    if longest > 60:
        ax.set_xscale("symlog", linthresh=10)
        ax.set_xlim(0, 1.5 * longest)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlim(-0.04 * max(longest, 1), 1.04 * max(longest, 1))


def _seconds(ax: Axes, longest: float) -> None:
    ax.set_xscale("log")
    if longest <= 0:  # nothing to draw: the axis cannot find limits of its own
        ax.set_xlim(0.1, 1.0)
    decades(ax.xaxis, *ax.get_xlim())


def plot_convergence(solutions: Mapping[str, Solution], *, ax: Axes, time: bool = False) -> Axes:
    """(cost - best) / (cost at the start - best) of every iterate, one line per solver.

    Against the iterations, or against the time.

    `best` is the lowest cost that any of them found; what equals it is drawn on a floor, since
    the axis is logarithmic. A hollow end means that the solver did not converge.
    """
    gaps = {name: shares_above(solution, solutions) for name, solution in solutions.items()}
    floor = _floor(gaps)
    longest, styles, lowest = 0.0, solver_styles(solutions), as_good(solutions)
    for name, solution in solutions.items():
        iterates = [
            (max(iterate.seconds, 1e-4) if time else float(i), above)
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
    (_seconds if time else _iterations)(ax, longest)
    note_at(ax, "0: the lowest cost found", 0.01, floor, FAINT, above=-4.0)
    ax.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    ax.set(xlabel="time (s)" if time else "iteration", ylabel="(cost − best) / (start − best)")
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


def shares_above(solution: Solution, among: Mapping[str, Solution]) -> Array:
    """What is drawn: (cost - best) / (start - best) of each iterate; 0 where nothing was lost."""
    return share_left([i.cost for i in solution.trace], best_cost(among), start_cost(among))


def _floor(gaps: Mapping[str, Array]) -> float:
    every = np.concatenate([*gaps.values(), np.ones(1)])
    above = every[np.isfinite(every) & (every > COST_ROUNDING)]
    return float(max(COST_ROUNDING, 10.0 ** np.floor(np.log10(above.min()) - 0.5)))


def convergence_sheet(solutions: Mapping[str, Solution]) -> Figure:
    """Convergence against iterations and against time, with one legend."""
    plots = [partial(plot_convergence, solutions, time=time) for time in (False, True)]
    return side_by_side(plots, 8.0, 3.7 + 0.2 * ((len(solutions) + 1) // 2), columns=2)
