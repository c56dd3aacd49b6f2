"""The logarithm of a posterior, up to a constant, for many points at once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Mask
from workbench.errors import BadArgument, NotSupported
from workbench.problem import Problem
from workbench.problem.costs import CostGradients, CostMethod, Costs, interpreted
from workbench.sampling.subspace import Subspace

ROUNDING = 1e-10  # of the terms of a sum: zero, but for rounding
NUDGE = 1e-3  # of the size of an entry: far enough from a point where a derivative vanishes


@dataclass(frozen=True, eq=False)
class LogDensity:
    """log p(z) = -cost(x(z)); -infinity beyond bounds, constraints and domains of residuals.

    Every residual has a sigma, so the cost is minus a log posterior: least squares are Gaussian,
    and a robust term with rho is the likelihood exp(-rho / 2). A constraint counts as met within
    its tolerance. Where the cost is no number, the log density is -infinity as well.
    """

    problem: Problem  # the problem whose posterior it is
    fixed: Array  # the fixed numbers, flat
    subspace: Subspace  # what is sampled
    way: CostMethod = interpreted  # how costs are evaluated: `interpreted` or `compiled`

    def __call__(self, z: Array) -> Array:
        """The log density (M,) at z (M, k)."""
        x = self.subspace.points(z)
        return self._density(x, *self._argument(z, x))

    def at(self, x: Array) -> Array:
        """(M,) for all free numbers, x (M, n)."""
        return self._density(x, x, self._of_all)

    def with_gradient(self, z: Array) -> tuple[Array, Array]:
        """The log density (M,) at z (M, k), and its gradient (M, k); zero where that is no number.

        The gradient does not know of bounds, constraints and domains.
        """
        x = self.subspace.points(z)
        with np.errstate(all="ignore"):
            if self.subspace.entries_only:
                cost, slope = self._slopes_of_entries(z)
            else:
                cost, slope = self._slopes_of_all(x)
                slope = slope @ self.subspace.along
        positive = np.isfinite(cost) & self.allows(x)
        finite = np.asarray(np.isfinite(slope).all(axis=1))
        return np.where(positive, -cost, -np.inf), np.where(finite[:, None], -slope, 0.0)

    def allows(self, x: Array) -> Mask:
        """Which of the points x (M, n) meet all bounds, and all constraints to their tolerances."""
        problem, constraints = self.problem, self.problem.stacked_constraints
        met = np.asarray(((x >= problem.lower) & (x <= problem.upper)).all(axis=1))
        if constraints is not None and met.any():
            c = np.asarray(constraints.function(x[met].T, self.fixed)).T  # all points in one call
            outside = np.maximum(constraints.lower - c, c - constraints.upper)
            within = (outside / constraints.tolerance <= 1.0).all(axis=1)
            met[met] = np.isfinite(c).all(axis=1) & within
        return met

    def in_domain(self, z: Array) -> Mask:
        """Which of the points z (M, k) are in the domains of all residuals.

        Bounds and constraints are left aside, and the rest is as at w = 0.
        """
        if self.problem.domain is None:
            return np.ones(len(z), dtype=bool)
        argument, costs = self._argument(z, self.subspace.points(z))
        with np.errstate(all="ignore"):
            return np.isfinite(costs(argument))

    def _argument(self, z: Array, x: Array) -> tuple[Array, Costs]:
        """What costs are a function of, z or all free numbers x, and the function."""
        return (z, self._of_entries) if self.subspace.entries_only else (x, self._of_all)

    def _density(self, x: Array, argument: Array, costs: Costs) -> Array:
        allowed = self.allows(x)
        log_p = np.full(len(x), -np.inf)
        if allowed.any():
            with np.errstate(all="ignore"):
                cost = costs(argument[allowed])
            log_p[allowed] = np.where(np.isfinite(cost), -cost, -np.inf)
        return log_p

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


def refuse_undefined(problem: Problem, fixed_values: Array, x: Array) -> None:
    """Raise BadArgument if the residual is not finite at x (n,), or means nothing there."""
    if not np.isfinite(problem.residual(x, fixed_values)).all():
        raise BadArgument(
            "the residual is not finite where Laplace's approximation is to begin; solve the "
            "problem first, and begin at its answer"
        )
    if missed := outside_in_words(problem, fixed_values, x):
        raise BadArgument(
            f"the posterior has no density where it is to begin: {missed}; begin at another answer"
        )


def outside_in_words(problem: Problem, fixed_values: Array, x: Array) -> str:
    """The first domain of a residual that x (n,) is outside of, in words; "" if it is in all."""
    return "" if problem.domain is None else problem.domain.outside_in_words(x, fixed_values)


def violation_in_words(problem: Problem, fixed_values: Array, x: Array) -> str:
    """The first bound, the worst constraint or the first domain that a point x (n,) misses.

    In words; "" if there is none.
    """
    outside = np.flatnonzero((x < problem.lower) | (x > problem.upper))
    if outside.size:
        i = int(outside[0])
        limits = f"{problem.lower[i]:g} to {problem.upper[i]:g}"
        return f"{problem.free.label(i)} is {x[i]:g}, outside its bounds of {limits}"
    constraints = problem.stacked_constraints
    if constraints is not None:
        values = constraints.values(x, fixed_values)
        if constraints.violation(values) > 1.0:
            return constraints.worst(values)
    return outside_in_words(problem, fixed_values, x)


def refuse_flat(problem: Problem, fixed_values: Array, space: Subspace) -> None:
    """Raise NotSupported if an equation reads what is drawn, or bounds leave an entry one number.

    The points that meet an equation have no volume in the space of the draws, so a density on them
    is none in that space, and no proposal ever lands on them. An equation between numbers that
    all stay where they are is no obstacle. Whether it changes along what moves is asked of its
    Jacobian at three points, for at a single one a derivative may vanish.
    """
    pinned = np.flatnonzero((problem.lower == problem.upper)[space.entries])
    if pinned.size:
        raise NotSupported(
            f"{space.labels[int(pinned[0])]} has equal bounds, so there is nothing to draw; name "
            "the other entries alone, or widen its bounds"
        )
    constraints = problem.stacked_constraints
    if constraints is None or not constraints.equal.any():
        return
    moves = space.span
    rng = np.random.default_rng(0)
    read = np.zeros(constraints.size, dtype=bool)
    for size in (0.0, NUDGE, NUDGE):
        x = space.origin + size * (1 + abs(space.origin)) * rng.standard_normal(len(space.origin))
        here = constraints.linearize(x, fixed_values)
        read |= (abs(here.along(moves)) > ROUNDING * here.magnitudes_along(moves)).any(axis=1)
    wrong = np.flatnonzero(read & constraints.equal)
    if wrong.size:
        equation = constraints.label(int(wrong[0]))
        raise NotSupported(
            f"constraint {equation} is an equation that depends on what is to be drawn; the points "
            "that meet it have no volume, so no draw can lie on it. Replace it by a residual with "
            "a sigma that says how exactly it holds, or draw entries that it does not depend on. "
            "Where it is linear, put what it says into the residuals"
        )
