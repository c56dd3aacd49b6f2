"""CasADi functions of arrays: without conversions, for many arguments at once, as scalars."""

from collections.abc import Callable, Sequence
from threading import Lock

import casadi as cs
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from workbench.arrays import Array

MOST_SCALAR = 20_000  # instructions; above, operations on whole matrices are faster
IN_PLACE = 1000  # numbers, from which on they are read and written in place
TOGETHER = 32  # calls that one evaluation serves
MOST_NUMBERS = 500_000  # that one evaluation takes and gives: meshes are taken a few at a time
MANY_CALLS = 20  # of other functions, from which on a graph is evaluated in scalar instructions
MOST_SCALAR_OF_CALLS = 400_000  # instructions, up to which it is


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
            kept_alive = []  # until the function has read them
            for i, (memory, argument) in enumerate(zip(self._inputs, arguments, strict=True)):
                if memory.size < IN_PLACE:
                    memory[:] = argument.ravel()
                    continue
                flat = np.ascontiguousarray(argument, dtype=np.float64).ravel()
                assert flat.size == memory.size  # CasADi trusts it
                self._buffer.set_arg(i, memoryview(flat.data))
                kept_alive.append(flat)
            outputs = [
                output if output.size < IN_PLACE else np.empty(output.size)
                for output in self._outputs
            ]
            for i, output in enumerate(outputs):
                if output.size >= IN_PLACE:
                    self._buffer.set_res(i, memoryview(output.data))
            self._trigger()
            return [output.copy() if output.size < IN_PLACE else output for output in outputs]


# A function whose arguments have a row for each of M calls, (M, .), or one for all of them, (.), to
# a list of outputs (M, .). Nonzeros stand column by column, which for points is (N, 3) row by row.
Batched = Callable[..., list[Array]]


def scalar(function: cs.Function, longest: int = MOST_SCALAR) -> cs.Function | None:
    """The function in scalar instructions, if these are at most `longest`; None otherwise.

    A function that calls one written in Python, such as a Callback, has no such form.
    """
    rows = sum(function.nnz_out(i) for i in range(function.n_out()))
    if max(rows, *(function.nnz_in(i) for i in range(function.n_in()))) > longest:
        return None
    try:
        expanded = function if function.is_a("SXFunction") else function.expand()
    except RuntimeError:
        return None
    return expanded if expanded.n_instructions() <= longest else None


def without_calls(function: cs.Function) -> cs.Function:
    """The function in scalar instructions if it calls many small ones, or else as it is.

    A call costs a microsecond or so, often more than what is computed in it: the 197 pairs of
    capsules of a body, whose distances are calls, are differentiated in a fifth of the time.
    """
    if function.is_a("SXFunction"):
        return function
    called = (function.instruction_id(k) == cs.OP_CALL for k in range(function.n_instructions()))
    return (
        (scalar(function, MOST_SCALAR_OF_CALLS) or function)
        if sum(called) >= MANY_CALLS
        else function
    )


class Mapped:
    """A function that takes several rows per call; the last call repeats the last row."""

    def __init__(
        self, function: cs.Function, shared: Sequence[bool], together: int | None = None
    ) -> None:
        if together is None:
            numbers = function.nnz_in() + function.nnz_out()
            together = max(1, min(TOGETHER, MOST_NUMBERS // max(1, numbers)))
        self._shared, self._together = tuple(shared), together
        one_for_all = [i for i, s in enumerate(self._shared) if s]
        mapped = function.map(f"many_{function.name()}", "serial", together, one_for_all, [])
        self._function = Buffered(mapped)

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arguments (M, .), or (.) where they are shared; a list of outputs (M, .)."""
        M, together = count(arguments, self._shared), self._together
        pieces: list[list[Array]] = []
        for first in range(0, M, together):
            rows = np.minimum(np.arange(first, first + together), M - 1)
            some = (a if s else a[rows] for a, s in zip(arguments, self._shared, strict=True))
            pieces.append([out.reshape(together, -1) for out in self._function(*some)])
        if not pieces:
            outputs = range(self._function.function.n_out())
            return [np.empty((0, self._function.function.nnz_out(k) // together)) for k in outputs]
        if len(pieces) == 1 and together == M:
            return pieces[0]
        return [np.concatenate(parts)[:M] for parts in zip(*pieces, strict=True)]


def count(arguments: Sequence[Array], shared: Sequence[bool]) -> int:
    """M, the number of rows of the first argument that is not shared."""
    return next(len(a) for a, s in zip(arguments, shared, strict=True) if not s)


def sparse_constant(matrix: csc_array | csr_array | coo_array) -> cs.DM:
    """SciPy's matrix (m, n) as CasADi's, with the same stored entries, also those that are zero.

    `cs.DM(matrix)` needs five times as long, and in CasADi 3.7 it takes SciPy's sparse matrices
    but not its sparse arrays.
    """
    columns = csc_array(matrix).sorted_indices()  # a copy, which is CasADi's order
    columns.sum_duplicates()
    sparsity = cs.Sparsity(*columns.shape, columns.indptr.tolist(), columns.indices.tolist())
    return cs.DM(sparsity, columns.data.tolist())
