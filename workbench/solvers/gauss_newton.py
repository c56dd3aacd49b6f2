"""Gauss-Newton: believe the linear model, and walk back when it promised too much."""

from dataclasses import dataclass

import numpy as np

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.steps import LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.line_search import LineSearch, backtracking
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution


@dataclass(frozen=True)
class GaussNewton:
    """J'J p = -J'r, then a step along p; where J has no full rank, p is the shortest one."""

    line_search: LineSearch = backtracking
    linear_algebra: LinearAlgebra = automatic
    max_iterations: int = 100
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Jacobian at every iterate; no bounds. Without a line search it is there to teach."""
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.UNKNOWN,
            teaching=self.line_search is not backtracking,
            source="Gauss 1809; Armijo 1966 (the line search)",
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds or constraints."""
        refuse("gauss-newton", self.abilities, problem)
        with Run("gauss-newton", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            run.record(x, here.cost, run.optimality(x, here))
            while True:
                step = self.linear_algebra(here, 0.0, np.ones(len(x)))
                if step is None:
                    run.stall("the columns of the Jacobian are dependent; damp, or use automatic")
                length = self.line_search(run, x, here, step.p)
                to = x + length * step.p
                if np.array_equal(to, x):
                    run.stall()
                del here  # first: its memory serves the next one
                x, here = run.wrapped(to, run.linearize(to))
                run.record(x, here.cost, run.optimality(x, here), 0.0, step.by)
        return run.solution()
