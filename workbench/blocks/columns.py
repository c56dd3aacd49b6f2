"""A CasADi function of many rows by NumPy: each instruction once, for all rows together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

import casadi as cs
import numpy as np
import scipy.special

from workbench.arrays import Array
from workbench.blocks.batched import Batched, Mapped, count
from workbench.blocks.threaded import Threaded
from workbench.errors import NotSupported

WIDE = 256  # rows at a time: what is read and written stays in cache
KEPT = 4  # programs, for different numbers of rows
MANY = 48  # rows, from which on this is faster than CasADi's machine, row by row

MOVES = cs.OP_CONST, cs.OP_INPUT, cs.OP_OUTPUT


def _of_truth(ask: Any) -> Callable[..., Any]:
    return lambda a, b, to: ask(a, b, to, casting="unsafe")


OF: Mapping[int, Callable[..., Any]] = {
    cs.OP_ASSIGN: np.positive,
    cs.OP_ADD: np.add,
    cs.OP_SUB: np.subtract,
    cs.OP_MUL: np.multiply,
    cs.OP_DIV: np.divide,
    cs.OP_NEG: np.negative,
    cs.OP_SQ: np.square,
    cs.OP_TWICE: lambda a, to: np.add(a, a, to),
    cs.OP_INV: lambda a, to: np.divide(1.0, a, to),
    cs.OP_LT: _of_truth(np.less),
    cs.OP_LE: _of_truth(np.less_equal),
    cs.OP_EQ: _of_truth(np.equal),
    cs.OP_NE: _of_truth(np.not_equal),
    cs.OP_NOT: lambda a, to: np.equal(a, 0.0, to, casting="unsafe"),
    cs.OP_AND: _of_truth(np.logical_and),
    cs.OP_OR: _of_truth(np.logical_or),
    cs.OP_IF_ELSE_ZERO: lambda a, b, to: np.copyto(to, np.where(a != 0, b, 0.0)),
    cs.OP_POW: np.power,
    cs.OP_CONSTPOW: np.power,
    cs.OP_ATAN2: np.arctan2,
    cs.OP_FMIN: np.fmin,
    cs.OP_FMAX: np.fmax,
    cs.OP_HYPOT: np.hypot,
    cs.OP_COPYSIGN: np.copysign,
    cs.OP_FMOD: np.fmod,
    cs.OP_SQRT: np.sqrt,
    cs.OP_SIN: np.sin,
    cs.OP_COS: np.cos,
    cs.OP_TAN: np.tan,
    cs.OP_ASIN: np.arcsin,
    cs.OP_ACOS: np.arccos,
    cs.OP_ATAN: np.arctan,
    cs.OP_SINH: np.sinh,
    cs.OP_COSH: np.cosh,
    cs.OP_TANH: np.tanh,
    cs.OP_EXP: np.exp,
    cs.OP_LOG: np.log,
    cs.OP_LOG1P: np.log1p,
    cs.OP_EXPM1: np.expm1,
    cs.OP_FABS: np.fabs,
    cs.OP_FLOOR: np.floor,
    cs.OP_CEIL: np.ceil,
    cs.OP_SIGN: np.sign,
    cs.OP_ERF: scipy.special.erf,
}


class Columns:
    """A function in scalar instructions, each of which NumPy carries out for many rows at once.

    An instruction takes half a microsecond this way for some hundred rows, and ten nanoseconds for
    one row in CasADi's machine. Raises NotSupported for an instruction that NumPy has no word for.
    """

    def __init__(self, function: cs.Function, shared: Sequence[bool]) -> None:
        self._function, self._shared = function, tuple(shared)
        self._programs: dict[int, Program] = {}  # by the number of rows
        self._lock = Lock()
        for i in range(function.n_instructions()):
            operation = function.instruction_id(i)
            if operation not in OF and operation not in MOVES:
                raise NotSupported(
                    f"CasADi's operation {operation} in {function.name()!r} has no NumPy here"
                )

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arguments (M, .), or (.) where they are shared; a list of outputs (M, .)."""
        M = count(arguments, self._shared)
        sizes = [self._function.nnz_in(i) for i in range(len(self._shared))]
        flat = [
            a.reshape(size, 1) if same else a.reshape(M, size).T
            for a, size, same in zip(arguments, sizes, self._shared, strict=True)
        ]
        found = [np.empty((M, self._function.nnz_out(k))) for k in range(self._function.n_out())]
        with self._lock:
            for first in range(0, M, WIDE):
                rows = slice(first, min(first + WIDE, M))
                program = self._program(rows.stop - first)
                for here, a, same in zip(program.given, flat, self._shared, strict=True):
                    here[:] = a if same else a[:, rows]
                program.run()
                for whole, one in zip(found, program.found, strict=True):
                    whole[rows] = one.T
        return found

    def _program(self, rows: int) -> Program:
        if rows not in self._programs:
            if len(self._programs) == KEPT:
                self._programs.pop(next(iter(self._programs)))
            self._programs[rows] = Program.of(self._function, rows)
        return self._programs[rows]


@dataclass(frozen=True, eq=False)
class Program:
    """The instructions of a function for a number of rows, with the memory that they work on.

    Attributes:
        given: for each input, its numbers (n, rows).
        found: for each output, the same.
        steps: functions of NumPy's, and the arrays (rows,) that each reads and writes.
    """

    given: list[Array]
    found: list[Array]
    steps: list[tuple[Callable[..., Any], tuple[Array, ...]]]

    @staticmethod
    def of(function: cs.Function, rows: int) -> Program:
        """The program of a function whose instructions are all in OF."""
        given = [np.empty((function.nnz_in(i), rows)) for i in range(function.n_in())]
        found = [np.zeros((function.nnz_out(i), rows)) for i in range(function.n_out())]
        work = np.empty((function.sz_w(), rows))
        steps: list[tuple[Callable[..., Any], tuple[Array, ...]]] = []
        holds: dict[int, Array] = {}  # where the number in each place of CasADi's work vector is
        for i in range(function.n_instructions()):
            operation = function.instruction_id(i)
            to, of = function.instruction_output(i), function.instruction_input(i)
            if operation == cs.OP_CONST:
                holds[to[0]] = np.full(rows, float(function.instruction_constant(i)))
            elif operation == cs.OP_INPUT:
                holds[to[0]] = given[of[0]][of[1]]
            elif operation == cs.OP_OUTPUT:
                steps.append((np.positive, (holds[of[0]], found[to[0]][to[1]])))
            else:
                steps.append((OF[operation], (*(holds[k] for k in of), work[to[0]])))
                holds[to[0]] = work[to[0]]
        return Program(given, found, steps)

    def run(self) -> None:
        """Carry out all instructions."""
        with np.errstate(all="ignore"):  # as CasADi's machine
            for operation, of in self.steps:
                operation(*of)


class FewOrMany:
    """A function of scalar instructions: by CasADi's machine for few rows, by NumPy for many.

    The number of rows decides before they are divided among threads, so that the numbers are the
    same for any number of these.
    """

    def __init__(self, function: cs.Function, shared: Sequence[bool]) -> None:
        self._shared = tuple(shared)
        self._few: Batched = Threaded(lambda: Mapped(function, shared), shared)
        try:
            self._many: Batched = Columns(function, shared)
        except NotSupported:
            self._many = self._few

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arguments (M, .), or (.) where they are shared; a list of outputs (M, .)."""
        many = count(arguments, self._shared) >= MANY
        return (self._many if many else self._few)(*arguments)
