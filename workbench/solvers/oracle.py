"""A run's numbers as CasADi functions, for the solvers that CasADi calls."""

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, TypeVar

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array

from workbench.problem import Linearization
from workbench.problem.storage import Matrix, dense, entries_at, gram
from workbench.solvers.convexity import LEAST, reflected
from workbench.solvers.run import Run

Array = NDArray[np.float64]
Hessian = Callable[[Run, Array, Linearization], Array]
Compute = Callable[[Array, Array], float | Array]  # of x and the multipliers
T = TypeVar("T")


def gauss_newton_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """J'J: positive semidefinite, and exact where the residual vanishes."""
    return dense(here.normal)


def exact_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """J'J + sum r_i H_i, by algorithmic differentiation of the whole graph."""
    return run.hessian(x)


class Kept:
    """What was raised inside: it would lose its type on the way through C++."""

    error: BaseException | None = None


class Oracle:
    """Cost, constraints and their derivatives, one linearization per point for all of them.

    Each is made when it is asked for. Nothing that it makes points back at it, so that large
    Jacobians go with the last of a run.
    """

    def __init__(self, run: Run, hessian: Hessian | None) -> None:
        self._run, self._hessian, self._kept = run, hessian or gauss_newton_hessian, Kept()
        there = run.problem.stacked_constraints
        self._sizes = run.problem.free.size, 0 if there is None else there.size

    @cached_property
    def cost(self) -> "External":
        """Of x."""
        known = _asked_twice(self._run.cost)
        return self._external("cost", (), lambda x, _: known(x))

    @cached_property
    def gradient(self) -> "External":
        """Of the cost at x, (n,)."""
        at = self._run.linearize
        return self._external("gradient", self._sizes[:1], lambda x, _: at(x).gradient)

    @cached_property
    def constraints(self) -> "External":
        """Of x, (k,)."""
        known = _asked_twice(self._run.constraints)
        return self._external("constraints", self._sizes[1:], lambda x, _: known(x))

    @cached_property
    def constraint_jacobian(self) -> "External":
        """Of x, (k, n)."""
        n, k = self._sizes
        at = self._run.linearize

        def rows(x: Array, _: Array) -> Array:
            there = at(x).constraints
            return np.zeros((0, n)) if there is None else there.jacobian

        return self._external("jacobian", (k, n), rows)

    @cached_property
    def hessian(self) -> "External":
        """Of the cost at x, (n, n); as sparse as J'J, if it is that and J is sparse."""
        if self._normal is not None:
            return self._sparse("hessian", self._normal, lambda here: here.normal)
        return self._external("hessian", self._square, _of_cost(self._run, self._hessian))

    @cached_property
    def constraint_hessian(self) -> "External":
        """Of the constraints at x, each times its multiplier, (n, n)."""
        return self._external("bend", self._square, _of_constraints(self._run), multiplied=True)

    @cached_property
    def convex_hessian(self) -> "External":
        """Of both, with every eigenvalue that is below zero reflected, (n, n).

        A sparse J'J has none below zero: it is shifted by as much as `reflected` would at least.
        """
        if self._normal is not None:
            return self._sparse(
                "convex", self._normal, lambda here: _definite(here.normal), multiplied=True
            )
        of_cost, bend = _of_cost(self._run, self._hessian), _of_constraints(self._run)

        def convex(x: Array, multipliers: Array) -> Array:
            return reflected(of_cost(x, multipliers) + bend(x, multipliers)).matrix

        return self._external("convex", self._square, convex, multiplied=True)

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
    def _normal(self) -> csc_array | None:
        """Where J'J can be nonzero, if that is the Hessian, J is sparse and nothing is added."""
        problem = self._run.problem
        if self._hessian is not gauss_newton_hessian or problem.stacked_constraints is not None:
            return None
        if not problem.sparse:
            return None
        return csc_array(gram(csc_array(problem.pattern, dtype=float)) + eye_array(self._sizes[0]))

    def _sparse(
        self,
        name: str,
        pattern: csc_array,
        of: Callable[[Linearization], Matrix],
        *,
        multiplied: bool = False,
    ) -> "External":
        """A function of a linearization whose value is sparse."""
        n, run = self._sizes[0], self._run
        sparsity = cs.Sparsity(n, n, pattern.indptr.tolist(), pattern.indices.tolist())

        def entries(x: Array, _: Array) -> Array:
            return entries_at(csc_array(of(run.linearize(x))), pattern)

        sizes = n, self._sizes[1] if multiplied else 0
        return External(name, sizes, (pattern.nnz,), entries, run, self._kept, sparsity)

    def _external(
        self, name: str, shape: tuple[int, ...], compute: Compute, *, multiplied: bool = False
    ) -> "External":
        n, k = self._sizes
        sizes = n, k if multiplied else 0
        return External(name, sizes, shape, compute, self._run, self._kept)


def _definite(normal: Matrix) -> csc_array:
    """A sparse J'J with its diagonal raised by as little as tells it from a singular one."""
    least = LEAST * float(normal.diagonal().max(initial=0.0))
    return csc_array(normal + least * eye_array(normal.shape[0]))


def _asked_twice(function: Callable[[Array], T]) -> Callable[[Array], T]:
    """The same, and known at the last two points: SQP asks again beside the gradient."""
    known = lru_cache(maxsize=2)(lambda x: function(np.frombuffer(x)))
    return lambda x: known(x.tobytes())


def _of_cost(run: Run, hessian: Hessian) -> Callable[[Array, Array], Array]:
    return lambda x, _: hessian(run, x, run.linearize(x))


def _of_constraints(run: Run) -> Callable[[Array, Array], Array]:
    there, n = run.problem.stacked_constraints, run.problem.free.size
    if there is None:
        return lambda x, _: np.zeros((n, n))
    return lambda x, multipliers: there.hessian(x, run.fixed, multipliers)


class External(cs.Callback):  # type: ignore[misc]  # casadi's way of calling back
    """A CasADi function of x and multipliers whose value Python computes; NaN after an error.

    Numbers go through shared memory: a DM of a Hessian takes longer to make than the Hessian.
    """

    def __init__(
        self, name: str, sizes: tuple[int, int], shape: tuple[int, ...], compute: Compute,
        run: Run, kept: Kept, sparsity: cs.Sparsity | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self._sizes, self._shape = sizes, shape
        self._sparsity = cs.Sparsity.dense(*(shape or (1,))) if sparsity is None else sparsity
        self._compute, self._run, self._kept = compute, run, kept
        self.construct(name, {})

    def get_n_in(self) -> int:
        """How many arguments."""
        return 2

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        """Dense columns."""
        return cs.Sparsity.dense(self._sizes[i], 1)

    def get_sparsity_out(self, i: int) -> cs.Sparsity:
        """A dense number, column or matrix; or a sparse matrix, whose value is its nonzeros."""
        return self._sparsity

    def has_eval_buffer(self) -> bool:
        """Numbers come and go by memory, not as DM."""
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        """Called by CasADi."""
        if results[0] is None:  # nobody wants to know
            return 0
        out = np.frombuffer(results[0]).reshape(self._shape, order="F")  # column by column
        try:
            if self._kept.error is None:
                x = _inside(arguments[0], self._run)
                value = np.asarray(self._compute(x, _column(arguments[1], self._sizes[1])))
                if value.shape != self._shape:  # a user's Hessian
                    raise ValueError(f"{self.name()} is {self._shape}, not {value.shape}")
                out[...] = value
                return 0
        except BaseException as error:
            self._kept.error = error
        out[...] = np.nan
        return 0


class Recorder(cs.Callback):  # type: ignore[misc]
    """Adds a solver's iterates to the trace, and stops it when the run says so."""

    def __init__(self, run: Run, kept: Kept, sizes: tuple[int, int]) -> None:
        super().__init__()
        self._run, self._kept = run, kept
        n, k = sizes
        self._sizes = {"x": n, "lam_x": n, "f": 1, "g": k, "lam_g": k}
        self.construct("recorder", {})

    def get_n_in(self) -> int:
        """As many as a solver has outputs."""
        return int(cs.nlpsol_n_out())

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        """Dense columns."""
        return cs.Sparsity.dense(self._sizes.get(cs.nlpsol_out(i), 0), 1)

    def has_eval_buffer(self) -> bool:
        """Numbers come and go by memory, not as DM."""
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        """Called by CasADi; 1 stops the solver."""
        stop = 1.0
        if self._kept.error is None:
            try:
                x = _inside(arguments[0], self._run)
                here = self._run.linearize(x)
                self._run.record(x, here.cost, self._run.optimality(x, here))
                stop = 0.0
            except BaseException as error:
                self._kept.error = error
        if results[0] is not None:
            np.frombuffer(results[0])[:] = stop
        return 0


def _column(memory: Any, size: int) -> Array:
    """A copy of CasADi's memory; a missing argument is zero."""
    return np.zeros(size) if memory is None else np.array(np.frombuffer(memory))


def _inside(memory: Any, run: Run) -> Array:
    """A point between the bounds: an infeasible quadratic program may have led out of them."""
    problem = run.problem
    x = _column(memory, problem.free.size)
    return np.clip(x, problem.lower, problem.upper) if problem.bounded else x
