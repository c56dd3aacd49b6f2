"""A function that has every operation of CasADi's scalar instructions."""

import casadi as cs
import numpy as np


def every_operation() -> cs.Function:
    """Of x (3,) and y (2,)."""
    x, y = cs.SX.sym("x", 3), cs.SX.sym("y", 2)
    a, b, c = x[0], x[1], y[0]
    p = cs.fabs(a) + 0.1
    made = [
        a + b,
        a - c,
        a * c,
        a / p,
        -a,
        a**2,
        a + a,
        1 / p,
        a < b,
        a <= c,
        a == a * 1,
        cs.ne(a, b),
        cs.logic_not(a < 0),
        cs.logic_and(a > 0, b > 0),
        cs.logic_or(a > 0, b > 0),
        cs.if_else(a > 0, b, c),
        p**b,
        p**2.7,
        cs.sqrt(p),
        cs.sin(a),
        cs.cos(a),
        cs.tan(a),
        cs.exp(a),
        cs.log(p),
        cs.asin(cs.tanh(a)),
        cs.acos(cs.tanh(a)),
        cs.atan(a),
        cs.fabs(a),
        cs.sinh(a),
        cs.cosh(a),
        cs.floor(a),
        cs.ceil(a),
        cs.log1p(p),
        cs.expm1(a),
        cs.erf(a),
        cs.sign(a),
        cs.atan2(a, b),
        cs.fmin(a, b),
        cs.fmax(a, c),
        cs.hypot(a, b),
        cs.copysign(p, b),
        cs.fmod(a, p + 1),
        0 * a + y[1],
        cs.SX(np.inf) * p,
        cs.SX(0.25),
    ]
    return cs.Function("all", [x, y], [cs.densify(cs.vertcat(*made)), cs.densify(a * y)])
