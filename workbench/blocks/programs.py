"""CasADi functions of many rows by NumPy: a step for each group of equal instructions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as cs
import numpy as np
import scipy.special

from workbench.arrays import Array, Index
from workbench.blocks.schedule import Schedule, in_a_row

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


@dataclass(frozen=True, eq=False)
class Program:
    """The instructions of a function for a number of rows, with the memory that they work on.

    Attributes:
        given: for each input, its numbers (n, rows).
        found: for each output, the same.
        steps: functions of NumPy's, and the arrays that each reads and writes.
    """

    given: list[Array]
    found: list[Array]
    steps: list[tuple[Callable[..., Any], tuple[Array, ...]]]

    @staticmethod
    def of(schedule: Schedule, rows: int, found: Sequence[Array] | None = None) -> Program:
        """The program of a schedule whose operations are all in OF.

        `found` are the arrays (n, rows) that outputs are written to; new ones, if it is None.
        """
        edges = np.cumsum([0, *schedule.sizes]).tolist()
        constants = schedule.constants[:, None]
        leaves = edges[-1] + len(constants)
        place, size = places_of(schedule, leaves)
        work = np.empty((size, rows))
        work[edges[-1] : leaves] = constants
        widest = max((group.operands.shape[1] for group in schedule.groups), default=0)
        spare = np.empty((2, widest, rows))
        steps: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

        def read(values: Index, copy: Array) -> Array:
            """The rows of these values; a copy of them, where they do not stand in order."""
            if edges[-1] <= values.min() and values.max() < leaves:
                return np.asarray(constants[values - edges[-1]])
            at = place[values]
            if at.min() == at.max():
                return np.asarray(work[at[0] : at[0] + 1])
            if isinstance(stands := as_slice(at), slice):
                return np.asarray(work[stands])
            steps.append((_rows, (work, at, copy)))
            return copy

        for group in schedule.groups:
            n, first = group.operands.shape[1], place[group.first]
            of = [read(one, spare[k, :n]) for k, one in enumerate(group.operands)]
            steps.append((OF[group.operation], (*of, work[first : first + n])))
        if found is None:
            found = [np.empty((len(values), rows)) for values in schedule.outputs]
        for values, out in zip(schedule.outputs, found, strict=True):
            if len(values):
                steps.append((_rows, (work, place[values], out)))
        given = [work[a:b] for a, b in pairwise(edges)]
        return Program(given, list(found), steps)

    def run(self) -> None:
        """Carry out all instructions."""
        with np.errstate(all="ignore"):  # as CasADi's machine
            for operation, of in self.steps:
                operation(*of)


def as_slice(places: Index) -> slice | Index:
    """Places that stand `in_a_row` as a slice, if they are not all the same; others as they are."""
    step = int(places[1] - places[0]) if len(places) > 1 else 1
    if not step or not in_a_row(places):
        return places
    return slice(int(places[0]), int(places[-1]) + 1, step)


def _rows(work: Array, at: Index, copy: Array) -> None:
    work.take(at, 0, copy, "clip")  # without "clip", NumPy makes another copy


def places_of(schedule: Schedule, leaves: int) -> tuple[Index, int]:
    """The row of each value in memory, and how many rows there are.

    Results take the place of earlier ones that nothing needs any more.
    """
    place = np.arange(leaves + sum(group.operands.shape[1] for group in schedule.groups))
    last, size = schedule.last_use(), leaves
    free: list[tuple[int, int]] = []  # beginnings and ends of rows, in order
    ends: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for n, group in enumerate(schedule.groups):
        count = group.operands.shape[1]
        fits = [k for k, (a, b) in enumerate(free) if b - a >= count]
        if fits:
            k = min(fits, key=lambda k: free[k][1] - free[k][0])
            first, end = free.pop(k)
            if first + count < end:
                free.insert(k, (first + count, end))
        else:
            first, size = size, size + count
        place[group.first : group.first + count] = np.arange(first, first + count)
        ends[int(last[n])].append((first, first + count))
        free = _joined([*free, *ends.pop(n, [])])
    return place, size


def _joined(intervals: list[tuple[int, int]]) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for first, end in sorted(intervals):
        if found and found[-1][1] == first:
            found[-1] = found[-1][0], end
        else:
            found.append((first, end))
    return found
