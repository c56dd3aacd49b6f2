"""Whether an end of a least-squares run is probably not the lowest minimum.

Near a minimum where the residual is small, or the model nearly linear, the steps are nearly
Gauss-Newton steps, and three to five of them are enough. Many steps show that the residual is as
long as the radius of curvature of the model. There a least-squares problem easily has several
minima (Bates and Watts, Nonlinear Regression Analysis and Its Applications, 1988, chapter 7), and a
shorter first step from the same start often leads to a lower one.
"""

from collections.abc import Sequence

from workbench.problem import Problem
from workbench.solvers.no_minimum import LOOSE
from workbench.solvers.saddle import FEW
from workbench.solvers.solution import Iterate, Solution, Status

NEAR, MANY = 1.1, 10  # times the cost of the end; so many iterates below that are a slow approach
STATIONARY = 1e-6  # the `Problem.optimality` of iterates that are not counted any more
NEGLIGIBLE = 1e-12  # of the cost at the start: below, nothing is to be gained
CREEPING = 2.0  # times the cost in the second half of the iterates, at most: that is no progress
NO_MINIMUM = (Status.INSENSITIVE, Status.NO_FINITE_MINIMUM)


def may_be_repeated(problem: Problem, tolerance: float) -> bool:
    """Whether further attempts are made at all: in small problems without constraints.

    They are small if they have at most as many unknowns as the search for saddles looks at one by
    one. None are made with a tolerance with which an end is not judged.
    """
    few = problem.free.size <= FEW and problem.stacked_constraints is None
    return few and tolerance < LOOSE


def is_slow(trace: Sequence[Iterate], cost: float) -> bool:
    """Whether a point of this cost was approached slowly, and its cost is not negligible.

    The costs of ten or more iterates, which were not stationary yet, are at most a tenth above it.
    """
    if cost <= NEGLIGIBLE * trace[0].cost:
        return False
    near = [one for one in trace if one.cost <= NEAR * cost]
    return sum(one.optimality > STATIONARY for one in near) >= MANY


def is_doubtful(end: Solution) -> bool:
    """Whether a lower minimum is likely elsewhere.

    Doubtful are INSENSITIVE, NO_FINITE_MINIMUM, and an end that is CONVERGED or STALLED after
    a slow approach.
    """
    if end.status in NO_MINIMUM:
        return True
    return end.status in (Status.CONVERGED, Status.STALLED) and is_slow(end.trace, end.cost)


def is_creeping(trace: Sequence[Iterate]) -> bool:
    """Whether a run is slow where it is, and the second half of its steps did not halve the cost.

    One that goes down a long valley halves it many times.
    """
    here = trace[-1].cost
    return is_slow(trace, here) and trace[len(trace) // 2].cost <= CREEPING * here
