"""How solutions of one problem compare, from one start, by the names of their solvers."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Values
from workbench.errors import WorkbenchError
from workbench.experiments.blame import caused_by
from workbench.problem import Problem
from workbench.solvers import SOLVERS, Solution, Solver, Status

Array = NDArray[np.float64]
AS_GOOD = 1e-6  # of the best cost: ends that differ by less are the same end
SMALLEST = 1e-16  # of the cost at the start: below it a difference of costs is rounding


def best_cost(solutions: Mapping[str, Solution]) -> float:
    """The lowest cost that any of them found; NaN if none is finite."""
    return min((s.cost for s in solutions.values() if math.isfinite(s.cost)), default=math.nan)


def excess(solution: Solution, among: Mapping[str, Solution]) -> float:
    """(cost - best) / best among them, 0 where the difference is rounding."""
    return share_above(solution.cost, best_cost(among), start_cost(among))


def share_above(cost: float, best: float, start: float) -> float:
    """(cost - best) / best, 0 where that is rounding of the cost at the start.

    That is, as a share of the lowest cost; infinite above a best cost of 0.
    """
    above = cost - best
    if above <= SMALLEST * start:
        return 0.0
    return above / abs(best) if best else math.inf * above


def way_left(costs: ArrayLike, best: float, start: float) -> Array:
    """(cost - best) / (start - best): 1 at the start, 0 at the best; differences where the start
    is no higher than the best.
    """
    whole = start - best
    return (np.asarray(costs, dtype=float) - best) / (whole if whole > 0 else 1.0)


def start_cost(among: Mapping[str, Solution]) -> float:
    """The largest finite cost at which any of them began; 0 if none is known."""
    starts = [s.trace[0].cost for s in among.values() if s.trace]
    return max((cost for cost in starts if math.isfinite(cost)), default=0.0)


def as_good(solutions: Mapping[str, Solution]) -> tuple[str, ...]:
    """Those that end within one millionth of the best, in the order given: neither a clock nor
    rounding ranks them.
    """
    return tuple(name for name, s in solutions.items() if excess(s, solutions) <= AS_GOOD)


def catalogue_name(solver: Solver) -> str | None:
    """Under which name of `SOLVERS` a solver with the same options is."""
    return next((name for name, known in SOLVERS.items() if known == solver), None)


def compare(
    problem: Problem,
    start: Values,
    solved: Mapping[str, Solution],
    wanted: Sequence[str],
    progress: Callable[[str], object],
) -> tuple[dict[str, Solution], tuple[str, ...]]:
    """The solutions of the solvers wanted, by name, those in `solved` as they are.

    Whoever interrupts one from the keyboard wants no more of them: the names that this leaves
    out come second. A solver that is not made for the problem is left out, and `progress` told.
    """
    found = dict(solved)
    left = [name for name in dict.fromkeys(wanted) if name not in solved]
    stopped = any(s.status is Status.STOPPED for s in solved.values())
    while left and not stopped:
        name = left[0]
        progress(f"comparing: {name}")
        try:
            found[name] = SOLVERS[name].solve(problem, start)
            stopped = found[name].status is Status.STOPPED
        except (KeyboardInterrupt, SystemError) as error:
            if not caused_by(error, KeyboardInterrupt):
                raise
            break
        except WorkbenchError as error:
            progress(f"{name} cannot solve this: {error}")
        left = left[1:]
    order = dict.fromkeys((*(n for n in solved if n not in wanted), *wanted))
    return {name: found[name] for name in order if name in found}, tuple(left)
