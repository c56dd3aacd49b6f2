"""Which minimum an end belongs to: the one that Levenberg-Marquardt leads to from there.

Two minima are one if the residuals cannot tell them apart: 1/2 |r_a - r_b|^2, over the whitened
residuals, is at most a millionth of their cost, or what rounding explains. So whatever lies along
null directions, or a full turn away, counts as the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.comparison.feasible import feasible
from workbench.comparison.running import look
from workbench.problem import Problem
from workbench.solvers import Ipopt, LevenbergMarquardt, Solver
from workbench.solvers.starts import one_minimum

POLISH_SECONDS = 20.0  # at most, per end
POLISH_TO = 1e-13  # of Problem.optimality
STATIONARY = 1e-9  # of Problem.optimality: an end as good as this is not followed


@dataclass(frozen=True, eq=False)
class Basin:
    """A minimum that some ends lead to.

    Attributes:
        x: (n,) its lowest point.
        cost: the cost there.
        optimality: `Problem.optimality` there.
        residual: (m,) the whitened residual there.
    """

    x: Array
    cost: float
    optimality: float
    residual: Array


def polished(problem: Problem, x: Array, fixed: Array) -> Array:
    """Where Levenberg-Marquardt (IPOPT, with constraints) leads to from x; never to a higher cost,
    nor to a point that violates a limit.
    """
    options = {"gradient_tolerance": POLISH_TO, "max_seconds": POLISH_SECONDS}
    solver: Solver = LevenbergMarquardt(**options)  # type: ignore[arg-type]
    if problem.stacked_constraints is not None:
        solver = Ipopt(**options)  # type: ignore[arg-type]
    values = problem.values(x, fixed)
    try:
        found = problem.free.pack(solver.solve(problem, values).values)
    except Exception:  # an end at which nothing can be evaluated leads nowhere
        return x
    before, after = look(problem, x, fixed)[0], look(problem, found, fixed)[0]
    lower = after <= before or not np.isfinite(before)
    return found if lower and feasible(problem, found, fixed) else x


def basins(
    problem: Problem, fixed: Array, ends: Sequence[Array]
) -> tuple[tuple[Basin, ...], tuple[int, ...]]:
    """The basins, lowest first, and for each end the number of its own, 0 being the lowest.

    An end is not followed further if its residual already equals that of a known minimum, or if it
    is stationary.
    """
    found: list[list[Basin]] = []
    where = []
    for end in ends:
        basin = _at(problem, end, fixed)
        k = _place(problem, found, basin, fixed)
        if k is None:
            if not basin.optimality <= STATIONARY:
                basin = _at(problem, polished(problem, end, fixed), fixed)
                k = _place(problem, found, basin, fixed)
            if k is None:
                k = len(found)
                found.append([])
            found[k].append(basin)
        where.append(k)
    lowest = [min(members, key=lambda basin: basin.cost) for members in found]
    order = sorted(range(len(lowest)), key=lambda k: lowest[k].cost)
    rank = {k: i for i, k in enumerate(order)}
    return tuple(lowest[k] for k in order), tuple(rank[k] for k in where)


def _place(problem: Problem, found: list[list[Basin]], at: Basin, fixed: Array) -> int | None:
    """The first basin with a member that has the same residual."""
    for k, members in enumerate(found):
        for member in members:
            if one_minimum(problem, fixed, member.x, member.residual, at.residual):
                return k
    return None


def _at(problem: Problem, x: Array, fixed: Array) -> Basin:
    cost, optimality = look(problem, x, fixed)
    return Basin(x, cost, optimality, problem.residual(x, fixed))
