"""Whether a point is one that a problem allows."""

import numpy as np

from workbench.arrays import Array
from workbench.problem import Problem

ROOM = 1e-9  # of a number: rounding on a bound


def feasible(problem: Problem, x: Array, fixed: Array) -> bool:
    """Inside the bounds, and no constraint missed by more than its tolerance."""
    room = ROOM * np.maximum(1, abs(x))
    if not ((problem.lower <= x + room) & (x - room <= problem.upper)).all():
        return False
    there = problem.stacked_constraints
    return there is None or there.violation(there.values(x, fixed)) <= 1
