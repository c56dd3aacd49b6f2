"""Calling a CasADi function on NumPy memory."""

from threading import Lock

import casadi as cs
import numpy as np

from workbench.arrays import Array


class Buffered:
    """A CasADi function whose inputs and outputs are flat arrays of nonzeros, column by column.

    The ordinary call converts every argument to a DM and every result from one, which for a mesh
    costs more than the function itself. Threads that call it wait for each other.
    """

    def __init__(self, function: cs.Function) -> None:
        self.function = function
        self._lock = Lock()
        self._buffer, self._trigger = function.buffer()
        self._inputs = [np.zeros(function.nnz_in(i)) for i in range(function.n_in())]
        self._outputs = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
        for i, array in enumerate(self._inputs):
            self._buffer.set_arg(i, memoryview(array.data))
        for i, array in enumerate(self._outputs):
            self._buffer.set_res(i, memoryview(array.data))

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arrays as a user sees them, (N, 3) for a (3, N) input; copies of the outputs, flat."""
        with self._lock:
            for memory, argument in zip(self._inputs, arguments, strict=True):
                memory[:] = argument.ravel()
            self._trigger()
            return [output.copy() for output in self._outputs]
