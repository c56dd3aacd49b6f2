"""A run's numbers as CasADi functions, for the solvers that CasADi calls."""

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import TypeVar

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, eye_array

from workbench.arrays import Array
from workbench.problem import Linearization, Problem
from workbench.problem.nonzeros import entries_at
from workbench.problem.pattern import Pattern
from workbench.problem.storage import (
    Stored,
    dense,
    gram_of_nonzeros,
    is_sparse,
    unblocked,
)
from workbench.solvers.convexity import raised, reflected
from workbench.solvers.external import Compute, External, Kept, Recorder
from workbench.solvers.run import Run

Hessian = Callable[[Run, Array, Linearization], Stored]
T = TypeVar("T")


def gauss_newton_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """J'J: positive semidefinite, and exact where the residual vanishes."""
    return dense(here.normal)


def exact_hessian(run: Run, x: Array, here: Linearization) -> Stored:
    """J'J + sum r_i H_i, by algorithmic differentiation of the whole graph; sparse if stored so."""
    return run.hessian(x)


class Oracle:
    """Cost, constraints and their derivatives, one linearization per point for all of them.

    Each is made when it is asked for. Nothing that it makes points back at it, so that large
    Jacobians go with the last of a run. Where the problem's Jacobian, or that of its constraints,
    is sparse, so is the constraints' Jacobian here. Hessians are sparse where the one of the cost
    is J'J of a sparse J, or the exact one and stored by its nonzeros. Both kinds have the places of
    their nonzeros by structure, which do not change from point to point.
    """

    def __init__(self, run: Run, hessian: Hessian | None) -> None:
        self._run, self._hessian, self._kept = run, hessian or gauss_newton_hessian, Kept()
        there = run.problem.stacked_constraints
        self._sizes = run.problem.free.size, 0 if there is None else there.size

    @cached_property
    def cost(self) -> "External":
        """The cost as a function of x."""
        known = _asked_twice(self._run.cost)
        return self._external("cost", (), lambda x, _: known(x))

    @cached_property
    def gradient(self) -> "External":
        """Of the cost at x, (n,)."""
        at = self._run.linearize
        return self._external("gradient", self._sizes[:1], lambda x, _: at(x).gradient)

    @cached_property
    def constraints(self) -> "External":
        """The constraints as a function of x, (k,)."""
        known = _asked_twice(self._run.constraints)
        return self._external("constraints", self._sizes[1:], lambda x, _: known(x))

    @cached_property
    def constraint_jacobian(self) -> "External":
        """The Jacobian of the constraints as a function of x, (k, n)."""
        (n, k), at, problem = self._sizes, self._run.linearize, self._run.problem
        there = problem.stacked_constraints

        def rows(x: Array) -> Stored:
            seen = at(x).constraints
            return np.zeros((0, n)) if seen is None else seen.jacobian

        thin = problem.sparse or (there is not None and there.sparse) or self._places is not None
        if there is not None and thin:
            return self._sparse("jacobian", there.pattern, lambda x, _: rows(x))
        return self._external("jacobian", (k, n), lambda x, _: dense(rows(x)))

    @cached_property
    def hessian(self) -> "External":
        """Of the cost at x, (n, n)."""
        of_cost = _of_cost(self._run, self._hessian)
        if self._places is not None:
            return self._sparse("hessian", self._places, of_cost)
        return self._external("hessian", self._square, lambda x, y: dense(of_cost(x, y)))

    @cached_property
    def constraint_hessian(self) -> "External":
        """Of the constraints at x, each times its multiplier, (n, n)."""
        there, bend = self._run.problem.stacked_constraints, _of_constraints(self._run)
        if there is not None and self._places is not None:
            return self._sparse("bend", there.hessian_pattern, bend, multiplied=True)
        return self._external("bend", self._square, lambda x, y: dense(bend(x, y)), multiplied=True)

    @cached_property
    def convex_hessian(self) -> "External":
        """Of both, made positive definite, (n, n).

        Eigenvalues of an array that are below zero are `reflected`. Those of a sparse matrix are
        too many to compute; there the diagonal is `raised`.
        """
        of_cost, bend = _of_cost(self._run, self._hessian), _of_constraints(self._run)
        there, at = self._run.problem.stacked_constraints, self._run.linearize

        def of_both(x: Array, multipliers: Array) -> Stored:
            H = of_cost(x, multipliers)
            if there is None:
                return H
            if isinstance(H, csc_array):
                return csc_array(H + csc_array(bend(x, multipliers)))
            return H + dense(bend(x, multipliers))

        if self._places is None:
            return self._external(
                "convex",
                self._square,
                lambda x, y: reflected(dense(of_both(x, y))).matrix,
                multiplied=True,
            )
        places = self._places + eye_array(self._sizes[0])
        if there is not None:
            places = places + there.hessian_pattern

        def convex(x: Array, multipliers: Array) -> Stored:
            return raised(unblocked(at(x).normal), of_both(x, multipliers)).matrix

        return self._sparse("convex", csc_array(places), convex, multiplied=True)

    @cached_property
    def recorder(self) -> "Recorder":
        """What tells the run of iterates."""
        return Recorder(self._run, self._kept, self._sizes)

    @property
    def error(self) -> BaseException | None:
        """What was raised inside, if anything was."""
        return self._kept.error

    @property
    def _square(self) -> tuple[int, int]:
        return self._sizes[0], self._sizes[0]

    @cached_property
    def _places(self) -> csc_array | None:
        """Where the Hessian of the cost can be nonzero, if it is sparse."""
        if self._hessian is gauss_newton_hessian:
            return _normal_places(self._run.problem)
        return _exact_places(self._run.problem) if self._hessian is exact_hessian else None

    def _sparse(
        self,
        name: str,
        pattern: csc_array,
        of: Callable[[Array, Array], Stored],
        *,
        multiplied: bool = False,
    ) -> "External":
        """A function of x and multipliers whose value is zero but at the places of a pattern."""
        (n, k), run = self._sizes, self._run
        pattern.sort_indices()
        sparsity = cs.Sparsity(*pattern.shape, pattern.indptr.tolist(), pattern.indices.tolist())

        def entries(x: Array, multipliers: Array) -> Array:
            return entries_at(of(x, multipliers), pattern)

        sizes = n, k if multiplied else 0
        return External(name, sizes, (pattern.nnz,), entries, run, self._kept, sparsity)

    def _external(
        self, name: str, shape: tuple[int, ...], compute: Compute, *, multiplied: bool = False
    ) -> "External":
        n, k = self._sizes
        sizes = n, k if multiplied else 0
        return External(name, sizes, shape, compute, self._run, self._kept)


def _normal_places(problem: Problem) -> csc_array | None:
    """Where J'J can be nonzero, and the diagonal, if J is sparse."""
    if not problem.sparse:
        return None
    normal = gram_of_nonzeros(csc_array(problem.pattern, dtype=float))
    return csc_array(normal + eye_array(problem.free.size))


def _exact_places(problem: Problem) -> csc_array | None:
    """Where the exact Hessian can be nonzero, if it is stored by its nonzeros."""
    there, n = Pattern(problem.hessian.sparsity_out(0)), problem.free.size
    nonzeros = len(there.rows)
    return there.matrix(np.ones(nonzeros)) if is_sparse(n, n, nonzeros) else None


def _asked_twice(function: Callable[[Array], T]) -> Callable[[Array], T]:
    """The same, and known at the last two points: SQP asks again beside the gradient."""
    known = lru_cache(maxsize=2)(lambda x: function(np.frombuffer(x)))
    return lambda x: known(x.tobytes())


def _of_cost(run: Run, hessian: Hessian) -> Callable[[Array, Array], Stored]:
    """Of x and multipliers, which it does not read."""
    if hessian is gauss_newton_hessian:
        return lambda x, _: unblocked(run.linearize(x).normal)

    def of_the_user(x: Array, _: Array) -> Stored:
        found = hessian(run, x, run.linearize(x))
        return found if isinstance(found, csc_array) else np.asarray(found)

    return of_the_user


def _of_constraints(run: Run) -> Callable[[Array, Array], Stored]:
    """Of x and multipliers."""
    there, n = run.problem.stacked_constraints, run.problem.free.size
    if there is None:
        return lambda x, _: np.zeros((n, n))
    return lambda x, multipliers: there.hessian(x, run.fixed, multipliers)
