"""A linearization for whoever asks for the residual, the gradient and the column norms alone."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from workbench.problem.linearization import Linearization
from workbench.problem.problem import Problem

Array = NDArray[np.float64]
LARGE = 2**24  # entries of a Jacobian, 128 MB


def outline_at(problem: Problem, x: Array, fixed: Array) -> Linearization:
    """As `Problem.linearize_at`; the Jacobian of a large problem is a sparse array in it."""
    if problem.size * problem.free.size <= LARGE:
        return problem.linearize_at(x, fixed)
    there = problem.stacked_constraints
    constraints = None if there is None else there.linearize(x, fixed)
    residual, jacobian = problem.sparsely(x, fixed)
    return Linearization(residual, cast(Array, jacobian), constraints)
