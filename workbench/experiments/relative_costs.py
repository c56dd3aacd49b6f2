"""Costs of solutions of one problem, relative to the lowest of them and to that at the start."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.solvers import Solution, Status
from workbench.solvers.starts import AS_GOOD

SMALLEST = 1e-16  # of the cost at the start: below it a difference of costs is rounding


def best_cost(solutions: Mapping[str, Solution]) -> float:
    """The lowest cost among solutions; NaN if none is finite."""
    return min((s.cost for s in solutions.values() if math.isfinite(s.cost)), default=math.nan)


def excess(solution: Solution, among: Mapping[str, Solution]) -> float:
    """By which share of the lowest of several costs a solution's cost exceeds it."""
    return relative_excess(solution.cost, best_cost(among), start_cost(among))


def relative_excess(cost: float, best: float, start: float) -> float:
    """(cost - best) / best; 0 where the difference is rounding of the cost at the start.

    It is infinite for a cost above a best cost of 0.
    """
    above = cost - best
    if above <= SMALLEST * start:
        return 0.0
    return above / abs(best) if best else math.inf * above


def share_left(costs: ArrayLike, best: float, start: float) -> Array:
    """(costs - best) / (start - best): 1 at the start, 0 at the best.

    Where the start is no higher than the best, the differences costs - best are returned.
    """
    whole = start - best
    return (np.asarray(costs, dtype=float) - best) / (whole if whole > 0 else 1.0)


def start_cost(among: Mapping[str, Solution]) -> float:
    """The largest finite cost at which one of the solutions began; 0 if none is known."""
    starts = [s.trace[0].cost for s in among.values() if s.trace]
    return max((cost for cost in starts if math.isfinite(cost)), default=0.0)


def as_good(solutions: Mapping[str, Solution]) -> tuple[str, ...]:
    """The names of solutions within one millionth of the lowest cost, in the order given.

    They count as equally good, whatever their times and the rounding of their costs.
    """
    return tuple(name for name, s in solutions.items() if excess(s, solutions) <= AS_GOOD)


def ending_in_words(status: Status, above: bool) -> str:
    """How a solver ended: `converged, not lowest` where one of several costs is lower."""
    said = status.name.lower().replace("_", " ")
    return f"{said}, not lowest" if above and status is Status.CONVERGED else said
