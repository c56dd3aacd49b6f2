"""The logarithm of a posterior, up to a constant, for many points at once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Problem
from workbench.problem.costs import CostGradients, CostMethod, Costs, interpreted
from workbench.sampling.subspace import Subspace


@dataclass(frozen=True, eq=False)
class LogDensity:
    """log p(z) = -cost(x(z)); -infinity beyond bounds, constraints and domains of residuals.

    Every residual has a sigma, so the cost is minus a log posterior: least squares are Gaussian,
    and a robust term with rho is the likelihood exp(-rho / 2). A constraint counts as met within
    its tolerance. Where the cost is no number, the log density is -infinity as well.

    Attributes:
        problem: the problem whose posterior it is.
        fixed: the fixed numbers, flat.
        subspace: what is sampled.
        way: how costs are evaluated: `interpreted` or `compiled`.
    """

    problem: Problem
    fixed: Array
    subspace: Subspace
    way: CostMethod = interpreted

    def __call__(self, z: Array) -> Array:
        """The log density (M,) at z (M, k)."""
        x = self.subspace.points(z)
        return self._density(x, *self._by(z, x))

    def at(self, x: Array) -> Array:
        """(M,) for all free numbers, x (M, n)."""
        return self._density(x, x, self._of_all)

    def with_gradient(self, z: Array) -> tuple[Array, Array]:
        """The log density (M,) at z (M, k), and its gradient (M, k); zero where that is no number.

        The gradient does not know of bounds, constraints and domains.
        """
        x = self.subspace.points(z)
        plain = self.subspace.entries_only
        with np.errstate(all="ignore"):
            if plain:
                cost, slope = self._slopes_of_entries(z)
            else:
                cost, slope = self._slopes_of_all(x)
                slope = slope @ self.subspace.along
        known = np.isfinite(cost) & self.allows(x)
        fine = np.asarray(np.isfinite(slope).all(axis=1))
        return np.where(known, -cost, -np.inf), np.where(fine[:, None], -slope, 0.0)

    def allows(self, x: Array) -> Mask:
        """Which of the points x (M, n) meet all bounds, and all constraints to their tolerances."""
        problem, there = self.problem, self.problem.stacked_constraints
        met = np.asarray(((x >= problem.lower) & (x <= problem.upper)).all(axis=1))
        if there is not None and met.any():
            values = np.asarray(there.function(x[met].T, self.fixed)).T  # all points in one call
            miss = np.maximum(there.lower - values, values - there.upper) / there.tolerance
            met[met] = np.isfinite(values).all(axis=1) & (miss <= 1.0).all(axis=1)
        return met

    def in_domain(self, z: Array) -> Mask:
        """Which of the points z (M, k) are in the domains of all residuals.

        Bounds and constraints are left aside, and the rest is as at w = 0.
        """
        if self.problem.domain is None:
            return np.ones(len(z), dtype=bool)
        given, costs = self._by(z, self.subspace.points(z))
        with np.errstate(all="ignore"):
            return np.isfinite(costs(given))

    def _by(self, z: Array, x: Array) -> tuple[Array, Costs]:
        """What costs are a function of, z or all free numbers x, and the function."""
        return (z, self._of_entries) if self.subspace.entries_only else (x, self._of_all)

    def _density(self, x: Array, given: Array, costs: Costs) -> Array:
        allowed = self.allows(x)
        found = np.full(len(x), -np.inf)
        if allowed.any():
            with np.errstate(all="ignore"):
                cost = costs(given[allowed])
            found[allowed] = np.where(np.isfinite(cost), -cost, -np.inf)
        return found

    @cached_property
    def _of_entries(self) -> Costs:
        space = self.subspace
        return self.problem.costs(space.origin, self.fixed, space.entries, self.way)

    @cached_property
    def _of_all(self) -> Costs:
        return self.problem.costs(self.subspace.origin, self.fixed, None, self.way)

    @cached_property
    def _slopes_of_entries(self) -> CostGradients:
        space = self.subspace
        return self.problem.cost_gradients(space.origin, self.fixed, space.entries)

    @cached_property
    def _slopes_of_all(self) -> CostGradients:
        return self.problem.cost_gradients(self.subspace.origin, self.fixed, None)
