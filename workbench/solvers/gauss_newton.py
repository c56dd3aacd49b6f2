"""Gauss-Newton: believe the linear model, and walk back when it promised too much."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.solvers.run import Run, refuse_bounds
from workbench.solvers.solution import Callback, Solution

Array = NDArray[np.float64]
LineSearch = Callable[[Run, Array, Linearization, Array], float]


def full_step(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """Length 1, whatever happens: the method as Gauss had it."""
    return 1.0


def backtracking(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """Halve until the cost falls by 1e-4 of what its slope promises (Armijo 1966); 0 if it never
    does.
    """
    slope = float(here.gradient @ p)
    length = 1.0
    while length > 1e-10:
        if run.cost(x + length * p) <= here.cost + 1e-4 * length * slope:
            return length
        length /= 2
    return 0.0


@dataclass(frozen=True)
class GaussNewton:
    """J'J p = -J'r, then a step along p; where J has no full rank, p is the shortest one."""

    line_search: LineSearch = backtracking
    max_iterations: int = 100
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds."""
        refuse_bounds("gauss-newton", problem, "ipopt or an NLopt algorithm")
        with Run("gauss-newton", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            run.record(x, here.cost, run.optimality(x, here))
            while True:
                p = here.step()
                length = self.line_search(run, x, here, p)
                if length == 0 or np.array_equal(x + length * p, x):
                    run.stall()
                x = x + length * p
                here = run.linearize(x)
                run.record(x, here.cost, run.optimality(x, here))
        return run.solution()
