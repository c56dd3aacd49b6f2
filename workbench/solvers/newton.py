"""Newton's method on the cost: its exact Hessian, made positive definite where it is not."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np
import scipy.linalg

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.storage import dense
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.gauss_newton import LineSearch, backtracking
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, columns

LEAST_EIGENVALUE = 1e-8  # of the largest one, after the Hessian was made positive definite
Convexify = Callable[[Array], tuple[Array, float]]  # the matrix, and by how much it was changed


def shifted(H: Array) -> tuple[Array, float]:
    """H + tau I (n, n) with the smallest tau >= 0 that makes it positive definite, and tau.

    No eigenvalue is then below 1e-8 of the largest absolute one (Nocedal and Wright, Numerical
    Optimization, 2006, section 3.4).
    """
    values = np.linalg.eigvalsh(H)
    least = LEAST_EIGENVALUE * float(np.abs(values).max(initial=1e-300))
    tau = max(0.0, least - float(values.min()))
    return H + tau * np.eye(len(H)), tau


def reflected(H: Array) -> tuple[Array, float]:
    """H (n, n) with the absolute values of its eigenvalues, and the largest change of one.

    Steps then lead away from saddles. No eigenvalue is below 1e-8 of the largest.
    """
    values, vectors = np.linalg.eigh(H)
    least = LEAST_EIGENVALUE * float(np.abs(values).max(initial=1e-300))
    if values.min() >= least:
        return H, 0.0
    positive = np.maximum(np.abs(values), least)
    return (vectors * positive) @ vectors.T, float(np.max(positive - values))


@dataclass(frozen=True)
class Newton(Limits):
    """Newton's method: H p = -g with H = J'J + sum r_i H_i, then a line search along p.

    It converges quadratically at every minimum where H is positive definite. Elsewhere `convexify`
    makes H so in the metric D; by how much it was changed is the `damping` of each iterate. See
    Nocedal and Wright, Numerical Optimization, 2006, section 3.4.

    Attributes:
        convexify: how H is made positive definite: `reflected` (eigenvalues lose their signs), or
            `shifted` (a multiple of the identity is added).
        scaling: the metric D in which H is changed; with `columns`, units do not matter.
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
        source = "Nocedal and Wright 2006, section 3.4"
        return Abilities(Derivative.HESSIAN, Boxes.REFUSED, source=source)

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
                convex, change = self.convexify(even)
                p = -scipy.linalg.solve(convex, here.gradient / D, assume_a="pos") / D
                to = x + self.line_search(run, x, here, p) * p
                if np.array_equal(to, x):
                    run.stall()
                x, here = run.move(to, change, "cholesky")
        return run.solution()
