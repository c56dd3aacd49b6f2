"""Levenberg-Marquardt: believe the linear model as far as it keeps its promises."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.solvers.run import Run, refuse_bounds
from workbench.solvers.solution import Callback, Solution

Array = NDArray[np.float64]
Scaling = Callable[[Linearization], Array]
FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body


def identity(here: Linearization) -> Array:
    """D = I: a radian, a metre and a standard deviation of shape cost the same (Levenberg 1944)."""
    return np.ones(here.jacobian.shape[1])


def columns(here: Linearization) -> Array:
    """D = diag |J_i|: no entry's unit matters (Marquardt 1963). Right for regressions; on bodies
    it frees the entries that the data hardly see, and the fit wanders.
    """
    return np.where(here.column_norms > 0, here.column_norms, 1.0)


@dataclass(frozen=True)
class LevenbergMarquardt:
    """(J'J + damping D^2) p = -J'r; the damping follows the gain ratio (Nielsen 1999).

    The gain is the fall of the cost over the fall that the linear model predicts: a good step
    lowers the damping smoothly, a bad one is not taken and raises it faster and faster
    (Madsen, Nielsen and Tingleff, Methods for non-linear least squares problems, 2004, 3.2).
    """

    scaling: Scaling = identity
    first_damping: float = 1e-3  # of the largest (|J_i| / D_i)^2 at the start
    max_iterations: int = 200
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds."""
        refuse_bounds("levenberg-marquardt", problem, "ipopt or an NLopt algorithm")
        with Run("levenberg-marquardt", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            D = self.scaling(here)
            stiffest = float(np.max((here.column_norms / D) ** 2, initial=1e-300))
            damping, growth = self.first_damping * stiffest, 2.0
            run.record(x, here.cost, run.optimality(x, here), damping)
            while True:
                p = here.step(damping, D)
                promised = 0.5 * float(p @ (damping * D**2 * p - here.gradient))
                gain = (here.cost - run.cost(x + p)) / promised if promised > 0 else -np.inf
                if gain > 0:
                    x = x + p
                    here = run.linearize(x)
                    D = self.scaling(here)
                    damping *= max(FASTEST_FALL, 1 - (2 * gain - 1) ** 3)
                    growth = 2.0
                    run.record(x, here.cost, run.optimality(x, here), damping)
                elif damping > 1e16 * stiffest or np.array_equal(x + p, x):
                    run.stall()
                else:
                    damping *= growth
                    growth *= 2
        return run.solution()
