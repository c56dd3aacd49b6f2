"""Graphs of a few operations on whole arrays, number by number, carried out by NumPy.

CasADi copies the inputs of a graph before it computes with them, and the result afterwards. The
residual of points that were observed is a difference and a quotient, for which NumPy needs half of
the time, and finds the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array

OPERATIONS: dict[int, np.ufunc] = {
    cs.OP_ADD: np.add,
    cs.OP_SUB: np.subtract,
    cs.OP_MUL: np.multiply,
    cs.OP_DIV: np.divide,
}
SHORT = 12  # instructions; longer graphs are for CasADi


@dataclass(frozen=True)
class Step:
    """An operation on what stands in two places; its result goes to a third.

    `room` says whether that of the first operand can be used for it, because nobody else needs it.
    """

    operation: np.ufunc
    operands: tuple[int, int]
    place: int
    room: bool


@dataclass(frozen=True, eq=False)
class Elementwise:
    """A function of arrays with one output (m,), by operations on numbers in the same place.

    Attributes:
        given: by their places, which of the arguments inputs are.
        constants: numbers by their places.
        steps: the operations in order; the last one finds the output.
    """

    given: dict[int, int]
    constants: dict[int, float]
    steps: tuple[Step, ...]

    @staticmethod
    def of(function: cs.Function) -> Elementwise | None:
        """The function, if it consists of such operations alone; None otherwise."""
        if not function.is_a("MXFunction") or not 0 < function.n_instructions() <= SHORT:
            return None  # an output without numbers takes no instruction
        given: dict[int, int] = {}
        constants: dict[int, float] = {}
        steps: list[Step] = []
        held: dict[int, int] = {}  # the place of what is in a part of CasADi's work memory
        m, found = function.nnz_out(0), set[int]()  # the places of results
        for place in range(function.n_instructions()):
            kind, read = function.instruction_id(place), function.instruction_input(place)
            (made, *others) = function.instruction_output(place)
            if kind == cs.OP_OUTPUT:
                continue
            expression = function.instruction_MX(place)
            if others or not expression.is_dense():
                return None
            if kind == cs.OP_RESHAPE:  # the numbers stay where they are
                if made != read[0]:  # and may be read in both parts
                    found.discard(held[read[0]])
                held[made] = held[read[0]]
                continue
            if kind == cs.OP_INPUT and function.nnz_in(read[0]) == expression.numel() == m:
                given[place] = read[0]
            elif kind == cs.OP_CONST and expression.numel() == 1:
                constants[place] = float(expression)
            elif kind in OPERATIONS and expression.numel() == m:
                one, other = (held[part] for part in read)
                steps.append(
                    Step(OPERATIONS[kind], (one, other), place, made == read[0] and one in found)
                )
                found.add(place)
            else:
                return None
            held[made] = place
        last = function.instruction_input(function.n_instructions() - 1)
        right = steps and function.n_out() == 1 and held[last[0]] == steps[-1].place
        return Elementwise(given, constants, tuple(steps)) if right else None

    def __call__(self, *arguments: Array) -> list[Array]:
        """Arrays as a user sees them, (N, 3) for a (3, N) input; the output, flat."""
        at: dict[int, Array] = {place: np.array(x) for place, x in self.constants.items()}
        for place, which in self.given.items():
            at[place] = np.asarray(arguments[which], dtype=np.float64).ravel()
        with np.errstate(all="ignore"):  # as CasADi
            for step in self.steps:
                one, other = (at[place] for place in step.operands)
                at[step.place] = step.operation(one, other, out=one if step.room else None)
        return [at[self.steps[-1].place]]
