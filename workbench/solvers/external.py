"""What CasADi's solvers call: functions that Python computes, and what hears of iterates."""

from collections.abc import Callable
from typing import Any

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.solvers.run import Run

Compute = Callable[[Array, Array], float | Array]  # of x and the multipliers


class Kept:
    """What was raised inside: it would lose its type on the way through C++."""

    error: BaseException | None = None


class External(cs.Callback):  # type: ignore[misc]  # casadi's way of calling back
    """A CasADi function of x and multipliers whose value Python computes; NaN after an error.

    Numbers go through shared memory: a DM of a Hessian takes longer to make than the Hessian.
    """

    def __init__(
        self,
        name: str,
        sizes: tuple[int, int],
        shape: tuple[int, ...],
        compute: Compute,
        run: Run,
        kept: Kept,
        sparsity: cs.Sparsity | None = None,
    ) -> None:
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
