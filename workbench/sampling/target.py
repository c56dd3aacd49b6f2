"""The logarithm of a posterior, up to a constant, for many points at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.blocks.many import Evaluator, interpreted
from workbench.problem import Problem
from workbench.problem.batch import BatchedCost
from workbench.sampling.subspace import Subspace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Target:
    """log p(z) = -cost(x(z)); -infinity outside of the bounds and where the cost is no number.

    Every residual has a sigma, so the cost is minus a log posterior: least squares are Gaussian,
    and a robust term with rho is the likelihood exp(-rho / 2).
    """

    problem: Problem
    fixed: Array  # the fixed numbers, flat
    subspace: Subspace
    costs: BatchedCost

    @staticmethod
    def of(
        problem: Problem, fixed: Array, subspace: Subspace, by: Evaluator = interpreted
    ) -> "Target":
        """`by` evaluates the graphs."""
        return Target(problem, fixed, subspace, problem.costs(by))

    def __call__(self, z: Array) -> Array:
        """(M,) for z (M, k)."""
        return self.at(self.subspace.points(z))

    def at(self, x: Array) -> Array:
        """(M,) for all free numbers, x (M, n)."""
        inside = ((x >= self.problem.lower) & (x <= self.problem.upper)).all(axis=1)
        found = np.full(len(x), -np.inf)
        with np.errstate(all="ignore"):
            cost = self.costs(x[inside], self.fixed)
        found[inside] = np.where(np.isfinite(cost), -cost, -np.inf)
        return found
