"""CasADi's scalar functions evaluated in as many digits as are wanted, by mpmath.

The same instructions that CasADi runs in double precision are run on mpmath's numbers, so that
minima and derivatives can be checked without rounding. Constants are the doubles of the graph.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as cs
import mpmath as mp
import numpy as np

from workbench.arrays import Array
from workbench.errors import NotSupported
from workbench.problem import Problem

DIGITS = 40
UNARY: Mapping[int, Callable[[Any], Any]] = {
    cs.OP_ASSIGN: lambda a: a,
    cs.OP_NEG: lambda a: -a,
    cs.OP_EXP: mp.exp,
    cs.OP_LOG: mp.log,
    cs.OP_SQRT: mp.sqrt,
    cs.OP_SQ: lambda a: a * a,
    cs.OP_TWICE: lambda a: 2 * a,
    cs.OP_SIN: mp.sin,
    cs.OP_COS: mp.cos,
    cs.OP_TAN: mp.tan,
    cs.OP_ATAN: mp.atan,
    cs.OP_ASIN: mp.asin,
    cs.OP_ACOS: mp.acos,
    cs.OP_INV: lambda a: 1 / a,
    cs.OP_NOT: lambda a: mp.mpf(not a),
    cs.OP_FABS: abs,
    cs.OP_SIGN: mp.sign,
    cs.OP_SINH: mp.sinh,
    cs.OP_COSH: mp.cosh,
    cs.OP_TANH: mp.tanh,
    cs.OP_LOG1P: mp.log1p,
    cs.OP_EXPM1: mp.expm1,
}
BINARY: Mapping[int, Callable[[Any, Any], Any]] = {
    cs.OP_ADD: lambda a, b: a + b,
    cs.OP_SUB: lambda a, b: a - b,
    cs.OP_MUL: lambda a, b: a * b,
    cs.OP_DIV: lambda a, b: a / b,
    cs.OP_POW: mp.power,
    cs.OP_CONSTPOW: mp.power,
    cs.OP_LT: lambda a, b: mp.mpf(a < b),
    cs.OP_LE: lambda a, b: mp.mpf(a <= b),
    cs.OP_EQ: lambda a, b: mp.mpf(a == b),
    cs.OP_NE: lambda a, b: mp.mpf(a != b),
    cs.OP_AND: lambda a, b: mp.mpf(bool(a) and bool(b)),
    cs.OP_OR: lambda a, b: mp.mpf(bool(a) or bool(b)),
    cs.OP_IF_ELSE_ZERO: lambda a, b: b if a else mp.mpf(0),
    cs.OP_FMIN: min,
    cs.OP_FMAX: max,
    cs.OP_ATAN2: mp.atan2,
    cs.OP_HYPOT: mp.hypot,
}

KNOWN = (*UNARY, *BINARY)


def _name_of(operation: int) -> str:
    """What CasADi calls an operation, such as OP_ERF."""
    operations = (name for name in dir(cs) if name.startswith("OP_"))
    return next((name for name in operations if getattr(cs, name) == operation), str(operation))


def evaluated(function: cs.Function, numbers: Sequence[Any]) -> Any:
    """The one dense output (rows, columns) of a scalar function of one dense vector, as a matrix.

    Raises NotSupported for an operation that is in neither table.
    """
    work: list[Any] = [mp.mpf(0)] * function.sz_w()
    shape = function.size_out(0)
    found = mp.matrix(*shape)
    nonzeros = function.sparsity_out(0).get_triplet()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        into, of = function.instruction_output(k), function.instruction_input(k)
        if operation == cs.OP_CONST:
            work[into[0]] = mp.mpf(function.instruction_constant(k))
        elif operation == cs.OP_INPUT:
            work[into[0]] = mp.mpf(numbers[of[1]])
        elif operation == cs.OP_OUTPUT:
            found[nonzeros[0][into[1]], nonzeros[1][into[1]]] = work[of[0]]
        elif operation in UNARY:
            work[into[0]] = UNARY[operation](work[of[0]])
        elif operation in BINARY:
            work[into[0]] = BINARY[operation](work[of[0]], work[of[1]])
        else:
            raise NotSupported(
                f"{function.name()!r} has CasADi's operation {_name_of(operation)}, which is not "
                f"evaluated in many digits; those that are: {', '.join(map(_name_of, KNOWN))}. "
                "Write the function with these, or add the operation to UNARY or BINARY"
            )
    return found


def residual_of(problem: Problem) -> cs.Function:
    """The residual (m,) as a scalar function of the free numbers (n,); nothing else is read."""
    x = cs.SX.sym("x", problem.free.size)
    r = problem.function.expand()(x, cs.DM.zeros(problem.fixed.size))
    return cs.Function("residual", [x], [cs.densify(r)])


def derivatives(residual: cs.Function) -> tuple[cs.Function, cs.Function]:
    """The gradient (n,) and the Hessian (n, n) of half the sum of squares."""
    x = cs.SX.sym("x", residual.size1_in(0))
    cost = cs.sumsqr(residual(x)) / 2
    H, g = cs.hessian(cost, x)
    return cs.Function("gradient", [x], [cs.densify(g)]), cs.Function("H", [x], [cs.densify(H)])


def newton_step(residual: cs.Function, x: Sequence[Any]) -> Any:
    """Newton's step (n,) from a point, in the digits that mpmath works in."""
    gradient, hessian = derivatives(residual)
    return mp.lu_solve(evaluated(hessian, x), -evaluated(gradient, x))


def refined(residual: cs.Function, x: Array, steps: int = 8) -> tuple[Array, float]:
    """The minimum next to a point, by Newton's method: the point (n,) and half the sum of squares.

    Raises ArithmeticError if the last step is not 1e-25 of the point, or leads to no minimum.
    """
    with mp.workdps(DIGITS):
        here = mp.matrix([mp.mpf(float(number)) for number in x])
        for _ in range(steps):
            step = newton_step(residual, list(here))
            here += step
            if mp.norm(step, mp.inf) <= mp.mpf("1e-25") * mp.norm(here, mp.inf):
                break
        else:
            raise ArithmeticError(f"the last step is still {mp.nstr(mp.norm(step, mp.inf), 3)}")
        H = evaluated(derivatives(residual)[1], list(here))
        size = np.array([float(mp.sqrt(abs(H[i, i]))) or 1.0 for i in range(H.rows)])
        curvature = np.array(H.tolist(), dtype=float) / np.outer(size, size)
        if np.linalg.eigvalsh(curvature)[0] < -1e-9:
            raise ArithmeticError("the point is a saddle")
        r = evaluated(residual, list(here))
        return np.array([float(n) for n in here]), float(mp.fdot(r, r) / 2)
