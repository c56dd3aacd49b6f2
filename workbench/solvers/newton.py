"""Newton's method on the cost: its exact Hessian, made positive definite where it is not."""

from dataclasses import KW_ONLY, dataclass

import numpy as np
import scipy.linalg

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.storage import dense
from workbench.solvers.abilities import WHOLE, Abilities, Boxes, Derivative
from workbench.solvers.convexity import Convexify, reflected
from workbench.solvers.limits import Limits
from workbench.solvers.line_search import LineSearch, backtracking
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, columns


@dataclass(frozen=True)
class Newton(Limits):
    """Newton's method: H p = -g with H = J'J + sum r_i H_i, then a line search along p.

    It converges quadratically at every minimum where H is positive definite. Far from a minimum H
    need not be, and the cost need not fall along p. `convexify` makes H positive definite in the
    metric D; by how much it was changed is the `damping` of each iterate, 0 where H was left as it
    is. See Nocedal and Wright, Numerical Optimization, 2006, section 3.4.

    Attributes:
        convexify: how H is made positive definite: `reflected` (eigenvalues lose their signs), or
            `shifted` (a multiple of the identity is added).
        scaling: the metric D in which H is changed; with `columns`, units do not
            matter.
        line_search: how far to go along p: `backtracking` or `full_step`.
    """

    convexify: Convexify = reflected
    scaling: Scaling = columns
    line_search: LineSearch = backtracking
    _: KW_ONLY
    max_iterations: int = 200

    @property
    def abilities(self) -> Abilities:
        """It needs a Hessian at every iterate, and takes no bounds."""
        return Abilities(
            Derivative.HESSIAN,
            Boxes.UNKNOWN,
            first_step=WHOLE,
            source="Nocedal and Wright 2006, section 3.4",
        )

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("newton", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
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
                x, here = run.move(to, convex.change, "cholesky")
        return run.solution()
