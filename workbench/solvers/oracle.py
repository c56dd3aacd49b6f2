"""A run's numbers as CasADi functions, for the solvers that CasADi calls."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import TypeVar

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, eye_array

from workbench.arrays import Array
from workbench.problem import Linearization, Problem
from workbench.problem.pattern import Pattern
from workbench.problem.storage import Stored, dense, gram_of_nonzeros, is_sparse, unblocked
from workbench.solvers.abilities import IN_A_RADIUS, WHOLE, Abilities, Boxes, Derivative
from workbench.solvers.convexity import raised, reflected
from workbench.solvers.damping import Damped
from workbench.solvers.external import Compute, External, Kept, Places, Recorder
from workbench.solvers.run import Run, has_one_pass

Hessian = Callable[[Run, Array, Linearization], Stored] | Damped
StoredBy = Callable[[Array, Array], Stored]  # of x (n,) and the multipliers (k,)
T = TypeVar("T")


def gauss_newton_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """The matrix J'J (n, n), positive semidefinite, and exact where the residual vanishes."""
    return dense(here.normal)


def exact_hessian(run: Run, x: Array, here: Linearization) -> Stored:
    """The Hessian of the cost (n, n), J'J + sum r_i H_i, by differentiation of the whole graph.

    It is sparse if it is large and most of it is zero.
    """
    return run.hessian(x)


def abilities_with(hessian: Hessian | None, source: str) -> Abilities:
    """What a solver can do that CasADi calls with this Hessian: it takes bounds and constraints."""
    damped = isinstance(hessian, Damped)
    first_derivatives = damped or hessian in (None, gauss_newton_hessian)
    return Abilities(
        Derivative.JACOBIAN if first_derivatives else Derivative.HESSIAN,
        Boxes.TAKEN,
        equations=True,
        inequalities=True,
        first_step=IN_A_RADIUS if damped else WHOLE,
        source=source,
    )


def is_of_first_order(hessian: Hessian | None) -> bool:
    """Whether a Hessian is made of J'J, which is then asked for at every iterate."""
    return isinstance(hessian, Damped) or hessian is gauss_newton_hessian


def unless_solved(run: Run, hessian: Hessian | None) -> None:
    """End the run if its start is already a solution; then no solver has to be made.

    From here on J'J comes with each Jacobian, if the Hessian needs it and one pass gives both; then
    trials are also linearized at once.
    """
    run.one_pass.on = is_of_first_order(hessian) and has_one_pass(run.problem)
    here = run.linearize(run.x)
    if run.optimality(run.x, here) <= run.limits.gradient_tolerance:
        run.record(run.x, here.cost, here)


class Oracle:
    """Cost, constraints and their derivatives as CasADi functions of x and the multipliers.

    All of them use one linearization per point, and each is made when it is first asked for.
    Nothing that an oracle makes refers back to it, so that large Jacobians are freed with the last
    reference to a run. The constraints' Jacobian is sparse where the problem's Jacobian or that of
    its constraints is. Hessians are sparse where the Hessian of the cost is J'J of a sparse J, or
    the exact one and stored by its nonzeros. The places of nonzeros follow from the structure and
    are the same at every point.
    """

    def __init__(
        self,
        run: Run,
        hessian: Hessian | None,
        functions: dict[str, External | Recorder] | None = None,
    ) -> None:
        """`functions` are those of an earlier oracle of such a problem, and get those made here."""
        self._run, self._kept = run, Kept()
        self._functions = {} if functions is None else functions
        self._hessian: Hessian = hessian or Damped()
        self._there = run.problem.stacked_constraints
        self._n, self._k = run.problem.free.size, 0 if self._there is None else self._there.size

    @cached_property
    def symbols(self) -> dict[str, cs.MX]:
        """What CasADi's functions depend on: x, p (none), and the multipliers of f and g."""
        return {
            "x": cs.MX.sym("x", self._n),
            "p": cs.MX(0, 1),
            "lam_f": cs.MX.sym("f"),
            "lam_g": cs.MX.sym("y", self._k),
        }

    def function(self, reads: Sequence[str], outputs: Mapping[str, cs.MX]) -> cs.Function:
        """A function of some of the `symbols`, with outputs under the names that CasADi expects."""
        arguments = [self.symbols[name] for name in reads]
        return cs.Function("oracle", arguments, [*outputs.values()], [*reads], [*outputs])

    def serve_again(self) -> None:
        """Let all functions of an earlier oracle compute the numbers of this run."""
        for name in self._functions:
            getattr(self, name)  # each is served when it is asked for

    def minimize(self, solver: cs.Function) -> None:
        """Run a solver of CasADi from the start of the run; raise what was raised inside."""
        problem, there = self._run.problem, self._there
        limits = {} if there is None else {"lbg": there.lower, "ubg": there.upper}
        if problem.bounded:
            limits |= {"lbx": problem.lower, "ubx": problem.upper}
        try:
            solver(x0=self._run.x, **limits)
        finally:
            if self.error is not None:
                raise self.error

    @cached_property
    def cost(self) -> External:
        """The cost at x (n,), half the sum of squares, as a number; infinite if not finite."""
        return self._external("cost", (), _asked_twice(_cost_of(self._run)))

    @cached_property
    def gradient(self) -> External:
        """The gradient of the cost at x, (n, 1)."""
        return self._external("gradient", (self._n,), _gradient_of(self._run))

    @cached_property
    def constraints(self) -> External:
        """The constraints at x, (k, 1)."""
        return self._external("constraints", (self._k,), _asked_twice(self._run.constraints))

    @cached_property
    def constraint_jacobian(self) -> External:
        """The Jacobian of the constraints at x, (k, n)."""
        n, at, there = self._n, self._run.linearize, self._there

        def rows(x: Array, _: Array) -> Stored:
            constraints = at(x).constraints
            return np.zeros((0, n)) if constraints is None else constraints.jacobian

        thin = self._run.problem.sparse or self._nonzeros is not None
        places: Places = self._k, n
        if there is not None and (thin or there.sparse):
            places = there.pattern
        return self._external("constraint_jacobian", places, rows)

    @cached_property
    def hessian(self) -> External:
        """The Hessian of the cost at x, (n, n)."""
        places = self._square if self._nonzeros is None else self._nonzeros
        return self._external("hessian", places, _of_cost(self._run, self._hessian))

    @cached_property
    def constraint_hessian(self) -> External:
        """The sum of the constraints' Hessians at x, each times its multiplier, (n, n)."""
        places: Places = self._square
        if self._there is not None and self._nonzeros is not None:
            places = self._there.hessian_pattern
        return self._external(
            "constraint_hessian", places, _of_constraints(self._run), multiplied=True
        )

    @cached_property
    def convex_hessian(self) -> External:
        """The Hessian of the Lagrangian at x, made positive definite, (n, n).

        Eigenvalues of an array that are below zero are `reflected`. Those of a sparse matrix are
        too many to compute; there the diagonal is `raised`.
        """
        of_cost, bend = _of_cost(self._run, self._hessian), _of_constraints(self._run)
        there, at = self._there, self._run.linearize

        def of_both(x: Array, multipliers: Array) -> Stored:
            H = of_cost(x, multipliers)
            if there is None:
                return H
            if isinstance(H, csc_array):
                return csc_array(H + csc_array(bend(x, multipliers)))
            return H + dense(bend(x, multipliers))

        def definite(x: Array, multipliers: Array) -> Stored:
            return reflected(dense(of_both(x, multipliers))).matrix

        def raised_at(x: Array, multipliers: Array) -> Stored:
            return raised(unblocked(at(x).normal), of_both(x, multipliers)).matrix

        if self._nonzeros is None:
            return self._external("convex_hessian", self._square, definite, multiplied=True)
        places = self._nonzeros + eye_array(self._n)
        if there is not None:
            places = places + there.hessian_pattern
        return self._external("convex_hessian", csc_array(places), raised_at, multiplied=True)

    @cached_property
    def recorder(self) -> Recorder:
        """The function that CasADi's solvers call at every iterate."""
        found = self._functions.get("recorder")
        if not isinstance(found, Recorder):
            found = self._functions["recorder"] = Recorder((self._n, self._k))
        found.serve(self._run, self._kept)
        return found

    @property
    def error(self) -> BaseException | None:
        """What was raised inside, if anything was."""
        return self._kept.error

    @property
    def _square(self) -> tuple[int, int]:
        return self._n, self._n

    @cached_property
    def _nonzeros(self) -> csc_array | None:
        """Where the Hessian of the cost can be nonzero, if it is sparse."""
        if is_of_first_order(self._hessian):
            return _nonzeros_of_normal(self._run.problem)
        return _nonzeros_of_exact(self._run.problem) if self._hessian is exact_hessian else None

    def _external(
        self, name: str, places: Places, compute: Compute, *, multiplied: bool = False
    ) -> External:
        found = self._functions.get(name)
        if not isinstance(found, External):
            sizes = self._n, self._k if multiplied else 0
            found = self._functions[name] = External(name, sizes, places)
        found.serve(compute, self._run, self._kept)
        return found


def _nonzeros_of_normal(problem: Problem) -> csc_array | None:
    """Where J'J can be nonzero, and the diagonal, if J is sparse."""
    if not problem.sparse:
        return None
    normal = gram_of_nonzeros(csc_array(problem.pattern, dtype=float))
    return csc_array(normal + eye_array(problem.free.size))


def _nonzeros_of_exact(problem: Problem) -> csc_array | None:
    """Where the exact Hessian can be nonzero, if it is stored by its nonzeros."""
    there, n = Pattern(problem.hessian.sparsity_out(0)), problem.free.size
    nonzeros = len(there.rows)
    return there.matrix(np.ones(nonzeros)) if is_sparse(n, n, nonzeros) else None


def _asked_twice(function: Callable[[Array], T]) -> Callable[[Array, Array], T]:
    """A function of x alone that keeps its last two values: SQP asks again beside the gradient."""
    known = lru_cache(maxsize=2)(lambda x: function(np.frombuffer(x)))
    return lambda x, _: known(x.tobytes())


def _cost_of(run: Run) -> Callable[[Array], float]:
    """The cost at a trial x. Where constraints or bounds have to be met, it may well rise."""
    if run.problem.stacked_constraints is not None or run.problem.bounded:
        return run.cost
    return lambda x: run.tried(x, run.best.cost)[0]


def _gradient_of(run: Run) -> Callable[[Array, Array], Array]:
    """The gradient of the cost, which is asked for at trials that are taken."""

    def gradient(x: Array, _: Array) -> Array:
        run.one_pass.judged(taken=True)
        return run.linearize(x).gradient

    return gradient


def _of_cost(run: Run, hessian: Hessian) -> StoredBy:
    """The Hessian of the cost, which does not depend on the multipliers."""
    if isinstance(hessian, Damped):
        return hessian.along(run)
    if hessian is gauss_newton_hessian:
        return lambda x, _: unblocked(run.linearize(x).normal)

    def given(x: Array, _: Array) -> Stored:
        found = hessian(run, x, run.linearize(x))
        return found if isinstance(found, csc_array) else np.asarray(found)

    return given


def _of_constraints(run: Run) -> StoredBy:
    """The sum of the constraints' Hessians, each times its multiplier."""
    there, n = run.problem.stacked_constraints, run.problem.free.size
    if there is None:
        return lambda x, _: np.zeros((n, n))
    return lambda x, multipliers: there.hessian(x, run.fixed, multipliers)
