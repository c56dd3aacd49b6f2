"""A run's numbers as CasADi functions, for the solvers that CasADi calls.

Where C++ calls Python, an exception counts as a failed evaluation, and Ctrl-C would be lost. So an
exception is kept, the value is NaN, and it is raised again outside.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any, TypeAlias, TypeVar
from weakref import proxy

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.problem.sparsity import entries_at
from workbench.problem.storage import Stored, dense
from workbench.solvers.newton import reflected
from workbench.solvers.run import Run

StoredBy = Callable[[Array, Array], Stored]  # of x (n,) and the multipliers (k,)
Compute = Callable[[Array, Array], float | Stored]
Places: TypeAlias = tuple[int, ...] | csc_array  # the shape of an array, or where nonzeros stand
T = TypeVar("T")


class Oracle:
    """Cost, constraints and their derivatives in a run, as CasADi functions of x and multipliers.

    All of them use one linearization per point, and each is made when it is first asked for. The
    constraints' Jacobian is sparse where the problem's Jacobian or that of its constraints is.
    Hessians are sparse if the places of the nonzeros of that of the cost are given; these follow
    from the structure and are the same at every point.

    Attributes:
        run: the run.
        compute: what each function computes, by its name.
        error: the exception that was raised inside; it would lose its type on the way through C++.
    """

    def __init__(self, run: Run, of_cost: StoredBy, nonzeros: csc_array | None) -> None:
        self.run, self.compute, self._nonzeros = run, _numbers_of(run, of_cost), nonzeros
        self.error: BaseException | None = None
        self._constraint_set = run.problem.stacked_constraints
        self._n = run.x.size
        self._k = 0 if self._constraint_set is None else self._constraint_set.size

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

    def minimize(self, solver: cs.Function) -> None:
        """Run a solver of CasADi from the start of the run; raise what was raised inside."""
        problem, constraints = self.run.problem, self._constraint_set
        limits = {} if constraints is None else {"lbg": constraints.lower, "ubg": constraints.upper}
        if problem.bounded:
            limits |= {"lbx": problem.lower, "ubx": problem.upper}
        try:
            solver(x0=self.run.x, **limits)
        finally:
            if self.error is not None:
                raise self.error

    @cached_property
    def cost(self) -> "External":
        """The cost at x (n,), half the sum of squares, as a number; infinite if not finite."""
        return self._external("cost", ())

    @cached_property
    def gradient(self) -> "External":
        """The gradient of the cost at x, (n, 1)."""
        return self._external("gradient", (self._n,))

    @cached_property
    def constraints(self) -> "External":
        """The constraints at x, (k, 1)."""
        return self._external("constraints", (self._k,))

    @cached_property
    def constraint_jacobian(self) -> "External":
        """The Jacobian of the constraints at x, (k, n)."""
        constraints = self._constraint_set
        if constraints is not None and (
            self.run.problem.sparse or self._nonzeros is not None or constraints.sparse
        ):
            return self._external("constraint_jacobian", constraints.pattern)
        return self._external("constraint_jacobian", (self._k, self._n))

    @cached_property
    def hessian(self) -> "External":
        """The Hessian of the cost at x, (n, n)."""
        return self._external("hessian", self._square)

    @cached_property
    def constraint_hessian(self) -> "External":
        """The sum of the constraints' Hessians at x, each times its multiplier, (n, n)."""
        places = self._square
        if self._constraint_set is not None and self._nonzeros is not None:
            places = self._constraint_set.hessian_pattern
        return self._external("constraint_hessian", places, multiplied=True)

    @cached_property
    def convex_hessian(self) -> "External":
        """The Hessian of the Lagrangian at x, (n, n), its negative eigenvalues `reflected`."""
        return self._external("convex_hessian", (self._n, self._n), multiplied=True)

    @cached_property
    def recorder(self) -> "Recorder":
        """The function that CasADi's solvers call at every iterate."""
        return Recorder((self._n, self._k), self)

    @property
    def _square(self) -> Places:
        return (self._n, self._n) if self._nonzeros is None else self._nonzeros

    def _external(self, name: str, places: Places, *, multiplied: bool = False) -> "External":
        return External(name, (self._n, self._k if multiplied else 0), places, self)


def _numbers_of(run: Run, of_cost: StoredBy) -> dict[str, Compute]:
    """What the functions of an oracle compute for a run, by their names.

    With constraints or bounds the cost may well rise, and no trial is linearized at once.
    """
    problem, constraint_set = run.problem, run.problem.stacked_constraints
    n = problem.free.size

    def trial_cost(x: Array) -> float:
        return run.evaluate_trial(x, run.best.cost)[0]

    def gradient(x: Array, _: Array) -> Array:
        run.one_pass.judged(taken=True)
        return run.linearize(x).gradient

    def constraint_jacobian(x: Array, _: Array) -> Stored:
        constraints = run.linearize(x).constraints
        return np.zeros((0, n)) if constraints is None else constraints.jacobian

    def of_constraints(x: Array, multipliers: Array) -> Stored:
        if constraint_set is None:
            return np.zeros((n, n))
        return constraint_set.hessian(x, run.fixed, multipliers)

    def convex(x: Array, multipliers: Array) -> Array:
        return reflected(dense(of_cost(x, multipliers)) + dense(of_constraints(x, multipliers)))[0]

    limited = constraint_set is not None or problem.bounded
    return {
        "cost": _keeping_two(run.cost if limited else trial_cost),
        "gradient": gradient,
        "constraints": _keeping_two(run.constraints),
        "constraint_jacobian": constraint_jacobian,
        "hessian": of_cost,
        "constraint_hessian": of_constraints,
        "convex_hessian": convex,
    }


def _keeping_two(function: Callable[[Array], T]) -> Callable[[Array, Array], T]:
    """A function of x alone that keeps its last two values: SQP asks again beside the gradient."""
    kept = lru_cache(maxsize=2)(lambda x: function(np.frombuffer(x)))
    return lambda x, _: kept(x.tobytes())


class External(cs.Callback):  # type: ignore[misc]  # CasADi has no other way of calling back
    """A CasADi function of x and multipliers whose value Python computes; NaN after an error.

    Its value is a number, an array, or a sparse matrix with nonzeros in given places.
    """

    def __init__(self, name: str, sizes: tuple[int, int], places: Places, oracle: Oracle) -> None:
        super().__init__()
        if isinstance(places, csc_array):
            places.sort_indices()
            starts, rows = places.indptr.tolist(), places.indices.tolist()
            self._shape: tuple[int, ...] = (places.nnz,)
            self._sparsity = cs.Sparsity(*places.shape, starts, rows)
        else:
            self._shape, self._sparsity = places, cs.Sparsity.dense(*(places or (1,)))
        self._name, self._sizes, self._places, self._oracle = name, sizes, places, proxy(oracle)
        self.construct(name, {})

    def get_n_in(self) -> int:
        """The number of arguments."""
        return 2

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        """Every argument is a dense column."""
        return cs.Sparsity.dense(self._sizes[i], 1)

    def get_sparsity_out(self, i: int) -> cs.Sparsity:
        """The places of the value: all of an array, or the nonzeros of a sparse matrix."""
        return self._sparsity

    def has_eval_buffer(self) -> bool:
        """Numbers are exchanged through shared memory, not as DM."""
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        """Write the value; called by CasADi."""
        if results[0] is None:  # the value is not needed
            return 0
        result = np.frombuffer(results[0]).reshape(self._shape, order="F")  # column by column
        oracle = self._oracle
        try:
            if oracle.error is None:
                x, y = _inside(arguments[0], oracle.run), _column(arguments[1], self._sizes[1])
                value = self._numbers(oracle.compute[self._name](x, y))
                if value.shape != self._shape:  # a user's Hessian
                    raise ValueError(f"{self._name} is {self._shape}, not {value.shape}")
                result[...] = value
                return 0
        except BaseException as error:
            oracle.error = error
        result[...] = np.nan
        return 0

    def _numbers(self, value: float | Stored) -> Array:
        if isinstance(self._places, csc_array) and not isinstance(value, float):
            return entries_at(value, self._places)
        return dense(value) if isinstance(value, csc_array) else np.asarray(value)


class Recorder(cs.Callback):  # type: ignore[misc]
    """Adds a solver's iterates to the trace of a run, and stops the solver when the run ends."""

    def __init__(self, sizes: tuple[int, int], oracle: Oracle) -> None:
        super().__init__()
        n, k = sizes
        self._sizes = {"x": n, "lam_x": n, "f": 1, "g": k, "lam_g": k}
        self._oracle = proxy(oracle)
        self.construct("recorder", {})

    def get_n_in(self) -> int:
        """The number of outputs of a solver."""
        return int(cs.nlpsol_n_out())

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        """Every argument is a dense column."""
        return cs.Sparsity.dense(self._sizes.get(cs.nlpsol_out(i), 0), 1)

    def has_eval_buffer(self) -> bool:
        """Numbers are exchanged through shared memory, not as DM."""
        return True

    def eval_buffer(self, arguments: list[Any], results: list[Any]) -> int:
        """Record an iterate; called by CasADi, which stops its solver if the value is 1."""
        stop, oracle = 1.0, self._oracle
        if oracle.error is None:
            try:
                x = _inside(arguments[0], oracle.run)
                here = oracle.run.linearize(x)
                oracle.run.record(x, here.cost, here)
                stop = 0.0
            except BaseException as error:
                oracle.error = error
        if results[0] is not None:
            np.frombuffer(results[0])[:] = stop
        return 0


def _column(memory: Any, size: int) -> Array:
    """A copy of CasADi's memory, (size,); zeros for a missing argument."""
    return np.zeros(size) if memory is None else np.array(np.frombuffer(memory))


def _inside(memory: Any, run: Run) -> Array:
    """The point (n,), moved between the bounds: an infeasible quadratic program may leave them."""
    problem = run.problem
    x = _column(memory, problem.free.size)
    return np.clip(x, problem.lower, problem.upper) if problem.bounded else x
