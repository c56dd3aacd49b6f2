"""Steepest descent: steps along the negative gradient."""

from dataclasses import KW_ONLY, dataclass

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import WHOLE, Abilities, Boxes, Derivative
from workbench.solvers.dogleg import cauchy_point
from workbench.solvers.limits import Limits
from workbench.solvers.line_search import LineSearch, backtracking
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, columns


@dataclass(frozen=True)
class SteepestDescent(Limits):
    """Steps along the negative gradient to the point where the linear model is least along it.

    The difference between the cost and its minimum falls by ((k - 1) / (k + 1))^2 per step, where k
    is the condition of J'J in the metric D (Nocedal and Wright, Numerical Optimization, 2006,
    theorem 3.4). With D = I, units alone can make the method hopelessly slow.

    Attributes:
        scaling: the metric D of the gradient; with `columns`, units of unknowns do not matter.
        line_search: how far to go towards the Cauchy point: `backtracking` or `full_step`.
    """

    scaling: Scaling = columns
    line_search: LineSearch = backtracking
    _: KW_ONLY
    max_iterations: int = 10_000
    max_evaluations: int = 50_000

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian for the length of the step, and is meant for teaching."""
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.UNKNOWN,
            teaching=True,
            first_step=WHOLE,
            source="Cauchy 1847",
        )

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("steepest-descent", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            while True:
                p = cauchy_point(here, self.scaling(here))
                to = x + self.line_search(run, x, here, p) * p
                if (to == x).all():
                    run.stall()
                x, here = run.move(to)
        return run.solution()
