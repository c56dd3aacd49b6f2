"""The Gauss-Newton method: the minimum of the linear model, then a line search towards it."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.steps import LinearAlgebra, automatic
from workbench.solvers.abilities import IN_A_RADIUS, WHOLE, Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.line_search import LineSearch, backtracking, full_step
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_radius import first_radius, radius_after, trusted


@dataclass(frozen=True)
class GaussNewton(Limits):
    """The Gauss-Newton method: J'J p = -J'r, then a step along p.

    Where J has no full rank, p is the shortest of the solutions. See Nocedal and Wright, Numerical
    Optimization, 2006, section 10.3. The line search begins inside a radius, so that no step leaps
    to where nothing is known. The first step is shorter than the start is far from zero, or than 1
    near zero, unless the linear model proves right farther out; each later step is at most twice as
    long as the one before, or as long as the linear model was right (see `trust_radius`).

    Attributes:
        line_search: how far to go along p: `backtracking`, or `full_step`, which always takes the
            whole step, as Gauss did, and heeds no radius.
        linear_algebra: how the step is computed; `automatic` chooses a factorization.
    """

    line_search: LineSearch = backtracking
    linear_algebra: LinearAlgebra = automatic

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes no bounds.

        Without a line search it is meant for teaching.
        """
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.UNKNOWN,
            teaching=self.line_search is not backtracking,
            first_step=WHOLE if self.line_search is full_step else IN_A_RADIUS,
            source="Gauss 1809; Armijo 1966 (the line search)",
        )

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("gauss-newton", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            radius = np.inf if self.line_search is full_step else first_radius(x, np.ones(len(x)))
            while True:
                step = self.linear_algebra(here, 0.0, np.ones(len(x)))
                if step is None:
                    run.stall("the columns of the Jacobian are dependent; damp, or use automatic")
                share = min(1.0, radius / max(float(np.linalg.norm(step.p)), 1e-300))
                p, length = step.p * share, 0.0
                if share < 1 and len(run.trace) == 1:
                    length = trusted(run, x, here, partial(np.multiply, p), 1 / share)
                length = length or self.line_search(run, x, here, p)
                p *= length
                if np.array_equal(x + p, x):
                    run.stall()
                before, change = here.residual, here.along(p)
                del here  # first: its memory serves the next one
                x, here = run.move(x + p, 0.0, step.by)
                next_one = radius_after(p, change, here.residual - before - change)
                radius = next_one if length < 1 else max(radius, next_one)
        return run.solution()
