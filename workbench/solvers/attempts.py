"""A further attempt to solve, where the end of one is no minimum or probably not the best.

Near a minimum where the residual is small, or the model nearly linear, the steps are nearly
Gauss-Newton steps, and three to five of them are enough. Many steps show that the residual is as
long as the radius of curvature of the model. There a least-squares problem easily has several
minima (Bates and Watts, Nonlinear Regression Analysis and Its Applications, 1988, chapter 7), and a
shorter first step from the same start often leads to a lower one.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from workbench.blocks import Values
from workbench.interrupts import Interrupts
from workbench.problem import Problem
from workbench.solvers.iterate import Iterate
from workbench.solvers.limits import stop_asked
from workbench.solvers.no_minimum import LOOSE
from workbench.solvers.run import INTERRUPTED
from workbench.solvers.saddle import FEW
from workbench.solvers.solution import Callback, Solution, Solver, Status

NEAR, MANY = 1.1, 10  # times the cost of the end; so many iterates below that are a slow approach
STATIONARY = 1e-6  # the `Problem.optimality` of iterates that are not counted any more
NEGLIGIBLE = 1e-12  # of the cost at the start: below, nothing is to be gained
LOWER = 1e-6  # of the cost: a smaller decrease is none
PATIENCE = 0.5  # of the evaluations of the first attempt, until the second must be lower


def is_doubtful(end: Solution, problem: Problem, tolerance: float) -> bool:
    """Whether a lower minimum is likely elsewhere; asked of small problems without constraints.

    They are small if they have at most as many unknowns as the search for saddles looks at one by
    one. Doubtful are LOST, VALLEY, and an end that is CONVERGED or STALLED after a slow approach:
    the costs of ten or more iterates, which were not stationary yet, are at most a tenth above that
    of the end, which is not negligible.
    """
    if problem.free.size > FEW or problem.stacked_constraints is not None or tolerance >= LOOSE:
        return False
    if end.status in (Status.LOST, Status.VALLEY):
        return True
    if end.status not in (Status.CONVERGED, Status.STALLED):
        return False
    if end.cost <= NEGLIGIBLE * end.trace[0].cost:
        return False
    near = [one for one in end.trace if one.cost <= NEAR * end.cost]
    return sum(one.optimality > STATIONARY for one in near) >= MANY


def joined(first: Solution, second: Solution) -> Solution:
    """The lower one of two ends, with the evaluations and the time of both.

    The trace is that of the lower one's attempt.
    """
    best = first
    if second.cost < first.cost * (1 - LOWER):
        best = replace(
            second,
            trace=tuple(after(first, iterate) for iterate in second.trace),
            message=f"{second.message}; a first attempt ended higher, at {first.cost:.6g}",
        )
    return replace(
        best,
        evaluations=first.evaluations + second.evaluations,
        seconds=first.seconds + second.seconds,
        judging=first.judging + second.judging,
    )


def after(first: Solution, iterate: Iterate) -> Iterate:
    """An iterate of a further attempt, with the evaluations and the time of the first one."""
    return replace(
        iterate,
        evaluations=first.evaluations + iterate.evaluations,
        seconds=first.seconds + iterate.seconds,
    )


def once_more(
    first: Solution,
    attempt: Callable[[Callback], Solution],
    callback: Callback,
    patience: float = PATIENCE,
) -> Solution:
    """The lower one of the `first` end and that of a further `attempt`, which takes a callback.

    The attempt is given up if it is not lower after so many times the evaluations of the first. An
    interrupt, or a `callback` that returns True, ends it, and the result is STOPPED.
    """
    longest, in_vain = patience * first.evaluations.total, False

    def told(iterate: Iterate) -> bool:
        nonlocal in_vain
        asked = None if callback is None else stop_asked(callback(after(first, iterate)))
        lower = iterate.cost < first.cost * (1 - LOWER)
        in_vain = asked is None and not lower and iterate.evaluations.total > longest
        return in_vain or asked is not None

    with Interrupts() as interrupts:  # also between the attempts
        second = attempt(told)
    found = joined(first, second)
    if (second.status is Status.STOPPED and not in_vain) or interrupts.pressed:
        why = INTERRUPTED if interrupts.pressed else second.message
        return replace(found, status=Status.STOPPED, message=why)
    return found


def beyond_saddle(
    first: Solution, solver: Solver, problem: Problem, start: Values, callback: Callback
) -> Solution:
    """Go on from the lower point beside a saddle, if that is where the `first` attempt ended."""
    if first.status is not Status.SADDLE or first.lower is None:
        return first
    beside = {**start, **first.lower}
    return once_more(
        first, lambda told: solver.solve(problem, beside, callback=told), callback, np.inf
    )
