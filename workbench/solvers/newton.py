"""Newton's method on the cost: the exact Hessian, made convex where it is not."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.storage import dense
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.convexity import Convexify, reflected
from workbench.solvers.line_search import LineSearch, backtracking
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, columns
from workbench.solvers.solution import Callback, Solution


@dataclass(frozen=True)
class Newton:
    """H p = -g with H = J'J + sum r_i H_i, then a line search; quadratic at every good minimum.

    Far from a minimum H need not be positive definite and p need not go down. `convexify` makes
    it so, in the metric D; by how much is the `damping` of each iterate, 0 where it was left as
    it is.
    """

    convexify: Convexify = reflected
    scaling: Scaling = columns
    line_search: LineSearch = backtracking
    max_iterations: int = 200
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Hessian at every iterate; no bounds."""
        return Abilities(
            Derivative.HESSIAN, Boxes.UNKNOWN, source="Nocedal and Wright 2006, section 3.4"
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; raises NotSupported for a problem with bounds or constraints."""
        refuse("newton", self.abilities, problem)
        with Run("newton", self, problem, start, callback) as run:
            x = run.x
            here = run.linearize(x)
            run.record(x, here.cost, run.optimality(x, here))
            while True:
                D = self.scaling(here)
                H = dense(run.hessian(x))
                even = H / D[:, None] / D
                if not np.isfinite(even).all():
                    run.stall(
                        "the Hessian over the squares of the columns of the Jacobian is no "
                        "number; choose units in which columns are neither so long nor so "
                        "short"
                    )
                convex = self.convexify(even)
                p = -scipy.linalg.solve(convex.matrix, here.gradient / D, assume_a="pos") / D
                to = x + self.line_search(run, x, here, p) * p
                if np.array_equal(to, x):
                    run.stall()
                x, here = run.wrapped(to, run.linearize(to))
                run.record(x, here.cost, run.optimality(x, here), convex.change, "cholesky")
        return run.solution()
