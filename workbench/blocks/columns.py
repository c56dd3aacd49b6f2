"""A CasADi function of many rows by NumPy: equal instructions together, for all rows at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks.batched import Batched, Mapped, count
from workbench.blocks.products import Before, blocks_of
from workbench.blocks.programs import MOVES, OF, Program, as_slice
from workbench.blocks.schedule import Schedule
from workbench.blocks.threaded import Threaded
from workbench.errors import NotSupported

WIDE = 256  # rows at a time: what is read and written stays in cache
KEPT = 4  # programs, for different numbers of rows
MANY = 48  # rows, from which on this is faster than CasADi's machine, row by row


class Columns:
    """A function in scalar instructions, which NumPy carries out in groups, for many rows at once.

    A step of NumPy's takes about a microsecond for some hundred numbers, and CasADi's machine takes
    ten nanoseconds for each. `before` is what makes the last two arguments, if they are not given.
    Raises NotSupported for an instruction that NumPy has no word for.
    """

    def __init__(
        self, function: cs.Function, shared: Sequence[bool], before: Before | None = None
    ) -> None:
        self._function, self._shared, self._before = function, tuple(shared), before
        self._made: dict[int, _Steps] = {}  # by the number of rows
        self._lock = Lock()
        for one in (function, *([] if before is None else [before.function])):
            for i in range(one.n_instructions()):
                operation = one.instruction_id(i)
                if operation not in OF and operation not in MOVES:
                    raise NotSupported(
                        f"CasADi's operation {operation} in {one.name()!r} has no NumPy here"
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
                given = [
                    a if same else a[:, rows] for a, same in zip(flat, self._shared, strict=True)
                ]
                results = self._steps(rows.stop - first).run(given)
                for whole, one in zip(found, results, strict=True):
                    whole[rows] = one.T
        return found

    def _steps(self, rows: int) -> _Steps:
        if rows not in self._made:
            if len(self._made) == KEPT:
                self._made.pop(next(iter(self._made)))
            self._made[rows] = _Steps.of(self._schedules, self._products, rows)
        return self._made[rows]

    @cached_property
    def _schedules(self) -> tuple[Schedule, Schedule | None]:
        before = None if self._before is None else Schedule.of(self._before.function)
        return Schedule.of(self._function), before

    @cached_property
    def _products(self) -> list[_Product]:
        """The blocks of the matrix, by the rows and columns that they stand in."""
        if self._before is None:
            return []
        A = self._before.matrix
        return [_Product(as_slice(r), as_slice(c), A[np.ix_(r, c)]) for r, c in blocks_of(A)]


@dataclass(frozen=True, eq=False)
class _Product:
    rows: slice | Index
    columns: slice | Index
    matrix: Array

    def put(self, u: Array, y: Array) -> None:
        """Into y (m, rows) what u (n, rows) gives."""
        if isinstance(self.rows, slice):
            np.matmul(self.matrix, u[self.columns], out=y[self.rows])
        else:
            y[self.rows] = self.matrix @ u[self.columns]


@dataclass(frozen=True, eq=False)
class _Steps:
    """The programs of a function and of what stands before it, and the products between them."""

    main: Program
    before: Program | None
    products: list[_Product]

    @staticmethod
    def of(
        schedules: tuple[Schedule, Schedule | None], products: list[_Product], rows: int
    ) -> _Steps:
        """The programs for a number of rows; the one before writes where the main one reads."""
        last, first = schedules
        main = Program.of(last, rows)
        if first is None:
            return _Steps(main, None, products)
        main.given[-1][:] = 0.0  # rows of the matrix without elements
        u = np.empty((len(first.outputs[0]), rows))
        return _Steps(main, Program.of(first, rows, (u, main.given[-2])), products)

    def run(self, given: Sequence[Array]) -> list[Array]:
        """The results (n, rows) of arguments (n, rows) or (n, 1)."""
        for here, a in zip(self.main.given, given, strict=False):  # all but what is made first
            here[:] = a
        if self.before is not None:
            for here, a in zip(self.before.given, given, strict=True):
                here[:] = a
            self.before.run()
            for product in self.products:
                product.put(self.before.found[0], self.main.given[-1])
        self.main.run()
        return self.main.found


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
