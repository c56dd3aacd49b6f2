"""Residuals and their derivatives by differences alone, in 50 digits where that is possible.

Nothing here uses a derivative of CasADi or of the workbench, so that it can judge what these say.
A residual that is one graph of scalar operations is evaluated by mpmath. Others, such as those of
bodies with more than `LARGEST` operations, are evaluated in double precision; their differences
have errors of about 1e-10, which are estimated with two widths.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cs
import mpmath as mp
import numpy as np

from benchmarks.gym.high_precision import BINARY, UNARY
from workbench.arrays import Array
from workbench.problem import Problem

DIGITS = 50
LARGEST = 20_000  # operations of a residual that mpmath evaluates
IN_DIGITS, IN_DOUBLES = f"{DIGITS} digits", "doubles"

Numbers = Any  # (n,) an array of floats, or of mpmath's numbers as objects


@dataclass(frozen=True)
class Arithmetic:
    """A residual in numbers of one kind, and differences in that kind.

    Attributes:
        name: the kind.
        residual: from numbers (n,) to the whitened residual (m,) in numbers of the kind.
        of: makes numbers of the kind from an array of floats.
        rounding: the relative rounding error of the kind.
    """

    name: str
    residual: Callable[[Numbers], Numbers]
    of: Callable[[Array], Numbers]
    rounding: float

    def column(self, x: Array, i: int, size: float) -> tuple[Numbers, Array]:
        """(m,) the derivative by x_i, and the error (m,) of the difference.

        `size` is how far x_i may move before the residual bends.
        """
        width = size * self.rounding ** (1 / 3)
        near, far = (self._slope(x, i, k * width) for k in (1, 2))
        return near, np.abs(near - far).astype(float)

    def falls(self, x: Array, direction: Array, lengths: Sequence[float]) -> Numbers:
        """(L,) by how much the cost is lower at x + length * direction."""
        here = self.residual(self.of(x))
        theirs = [self.residual(self.of(x) + length * self.of(direction)) for length in lengths]
        return np.array([(here - there) @ (here + there) / 2 for there in theirs])

    def curvature(self, x: Array, direction: Array, width: float) -> tuple[float, float]:
        """The second derivative of the cost along a direction (n,), and its error."""
        h = width * self.rounding ** (1 / 4)
        near, far = (
            -float(np.sum(self.falls(x, direction, (-k * h, k * h)))) / (k * h) ** 2 for k in (1, 2)
        )
        return near, abs(near - far)

    def _slope(self, x: Array, i: int, width: float) -> Numbers:
        ahead, behind = self.of(x), self.of(x)
        ahead[i], behind[i] = ahead[i] + width, behind[i] - width
        return (self.residual(ahead) - self.residual(behind)) / (ahead[i] - behind[i])


def arithmetic_of(problem: Problem, fixed: Array) -> Arithmetic:
    """The finest arithmetic in which the residual of a problem can be evaluated."""
    found = in_digits(problem, fixed)
    if found is not None:
        return found
    return Arithmetic(
        IN_DOUBLES, lambda x: problem.residual(x, fixed), lambda x: np.array(x, float), 2.0**-52
    )


def in_digits(problem: Problem, fixed: Array) -> Arithmetic | None:
    """The residual in `DIGITS` digits; None if it is too large or not a graph of scalars.

    mpmath must be working in that many digits (`mp.workdps`) whenever it is evaluated.
    """
    try:
        x = cs.SX.sym("x", problem.free.size)
        r = cs.densify(problem.function.expand()(x, cs.DM(fixed)))
        function = cs.Function("residual", [x], [r])
    except RuntimeError:  # an operation that has no scalar form
        return None
    if function.n_instructions() > LARGEST:
        return None
    program = _program(function)
    if program is None:
        return None

    def residual(numbers: Numbers) -> Numbers:
        work: list[Any] = [mp.mpf(0)] * function.sz_w()
        found = np.full(function.size1_out(0), mp.mpf(0), dtype=object)
        try:
            for into, compute, of in program:
                if compute is None:
                    found[into] = work[of[0]]
                else:
                    work[into] = compute(numbers, work, of)
        except (TypeError, ValueError) as error:  # a comparison of complex numbers, for example
            raise ArithmeticError(f"the residual is not real here: {error}") from error
        if any(isinstance(one, mp.mpc) for one in found):
            raise ArithmeticError("the residual is not real here")
        return found

    return Arithmetic(
        IN_DIGITS, residual, lambda x: np.array([mp.mpf(float(n)) for n in x]), 10.0**-DIGITS
    )


def _program(function: cs.Function) -> list[Any] | None:
    """The function's instructions; None if one of them is in no table."""
    program: list[Any] = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        into, of = function.instruction_output(k), function.instruction_input(k)
        if operation == cs.OP_CONST:
            constant = mp.mpf(function.instruction_constant(k))
            program.append((into[0], lambda x, w, of, c=constant: c, of))
        elif operation == cs.OP_INPUT:
            program.append((into[0], lambda x, w, of: x[of[1]], of))
        elif operation == cs.OP_OUTPUT:
            program.append((into[1], None, of))
        elif operation in UNARY:
            program.append((into[0], lambda x, w, of, f=UNARY[operation]: f(w[of[0]]), of))
        elif operation in BINARY:
            program.append(
                (into[0], lambda x, w, of, f=BINARY[operation]: f(w[of[0]], w[of[1]]), of)
            )
        else:
            return None
    return program
