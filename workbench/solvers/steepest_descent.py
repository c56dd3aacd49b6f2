"""Steepest descent: a gradient is a direction, not a step."""

from dataclasses import dataclass

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.dogleg import cauchy_point
from workbench.solvers.line_search import LineSearch, backtracking
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, columns
from workbench.solvers.solution import Callback, Solution


@dataclass(frozen=True)
class SteepestDescent:
    """Down the gradient in the metric D to the Cauchy point, where the linear model is least.

    The cost's excess falls by ((k - 1) / (k + 1))^2 per step, k the condition of J'J in that
    metric (Kantorovich 1948): with D = I, units alone can make it hopeless.
    """

    scaling: Scaling = columns
    line_search: LineSearch = backtracking
    max_iterations: int = 10_000
    max_evaluations: int = 50_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Jacobian for the length of the step; there to teach."""
        return Abilities(Derivative.JACOBIAN, Boxes.UNKNOWN, teaching=True, source="Cauchy 1847")

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds or constraints."""
        refuse("steepest-descent", self.abilities, problem)
        with Run("steepest-descent", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            run.record(x, here.cost, run.optimality(x, here))
            while True:
                p = cauchy_point(here, self.scaling(here))
                to = x + self.line_search(run, x, here, p) * p
                if (to == x).all():
                    run.stall()
                x, here = run.wrapped(to, run.linearize(to))
                run.record(x, here.cost, run.optimality(x, here))
        return run.solution()
