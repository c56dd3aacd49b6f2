"""Functions that CasADi's solvers call and Python computes, and a recorder of their iterates.

Where C++ calls Python, an exception counts as a failed evaluation, and Ctrl-C would be lost. So an
exception is kept, the value is NaN, and it is raised again outside. Numbers pass through shared
memory.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.problem.sparsity import entries_at
from workbench.problem.storage import Stored, dense
from workbench.solvers.run import Run

Compute = Callable[[Array, Array], float | Stored]  # of x (n,) and the multipliers (k,)
Places: TypeAlias = tuple[int, ...] | csc_array  # the shape of an array, or where nonzeros stand


class Kept:
    """The exception that was raised inside; it would lose its type on the way through C++."""

    error: BaseException | None = None


class External(cs.Callback):  # type: ignore[misc]  # CasADi has no other way of calling back
    """A CasADi function of x and multipliers whose value Python computes; NaN after an error.

    Its value is a number, an array, or a sparse matrix with nonzeros in given places. Numbers are
    exchanged through shared memory, because making a DM of a Hessian takes longer than computing
    the Hessian. What it computes, and for which run, is told by `serve`.
    """

    def __init__(self, name: str, sizes: tuple[int, int], places: Places) -> None:
        super().__init__()
        if isinstance(places, csc_array):
            places.sort_indices()
            starts, rows = places.indptr.tolist(), places.indices.tolist()
            self._shape: tuple[int, ...] = (places.nnz,)
            self._sparsity = cs.Sparsity(*places.shape, starts, rows)
        else:
            self._shape, self._sparsity = places, cs.Sparsity.dense(*(places or (1,)))
        self._sizes, self._places = sizes, places
        self._served: tuple[Compute, Run, Kept] | None = None
        self.construct(name, {})

    def serve(self, compute: Compute, run: Run, kept: Kept) -> None:
        """Compute this from now on, for this run."""
        self._served = compute, run, kept

    def leave(self) -> None:
        """Serve no run any more."""
        self._served = None

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
        out = np.frombuffer(results[0]).reshape(self._shape, order="F")  # column by column
        if self._served is None:
            return 1
        compute, run, kept = self._served
        try:
            if kept.error is None:
                x = _inside(arguments[0], run)
                value = self._numbers(compute(x, _column(arguments[1], self._sizes[1])))
                if value.shape != self._shape:  # a user's Hessian
                    raise ValueError(f"{self.name()} is {self._shape}, not {value.shape}")
                out[...] = value
                return 0
        except BaseException as error:
            kept.error = error
        out[...] = np.nan
        return 0

    def _numbers(self, value: float | Stored) -> Array:
        if isinstance(self._places, csc_array) and not isinstance(value, float):
            return entries_at(value, self._places)
        return dense(value) if isinstance(value, csc_array) else np.asarray(value)


class Recorder(cs.Callback):  # type: ignore[misc]
    """Adds a solver's iterates to the trace of a run, and stops the solver when the run ends."""

    def __init__(self, sizes: tuple[int, int]) -> None:
        super().__init__()
        self._served: tuple[Run, Kept] | None = None
        n, k = sizes
        self._sizes = {"x": n, "lam_x": n, "f": 1, "g": k, "lam_g": k}
        self.construct("recorder", {})

    def serve(self, run: Run, kept: Kept) -> None:
        """Record in the trace of this run from now on."""
        self._served = run, kept

    def leave(self) -> None:
        """Serve no run any more."""
        self._served = None

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
        stop = 1.0
        run, kept = self._served or (None, None)
        if run is not None and kept is not None and kept.error is None:
            try:
                x = _inside(arguments[0], run)
                here = run.linearize(x)
                run.record(x, here.cost, here)
                stop = 0.0
            except BaseException as error:
                kept.error = error
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
