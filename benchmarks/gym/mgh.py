"""Seventeen sums of squares of Moré, Garbow and Hillstrom, from 1, 10 and 100 times their starts.

Moré, Garbow and Hillstrom, Testing unconstrained optimization software, ACM TOMS 7(1), 1981: the
problems that Moré and Wild's set, which is the suite `more-wild`, left out, with the paper's
numbers in comments. Minimise 1/2 |f(x)|^2; the paper's minima are of |f(x)|^2.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case
from benchmarks.gym.published_function import PublishedFunction
from workbench.arrays import Array
from workbench.fitting.setup import Setup

SOURCE = "Moré, Garbow and Hillstrom 1981"
SCALES = (1, 10, 100)
GAUSSIAN = (0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989)


@dataclass(frozen=True)
class Function:
    """A function of the paper.

    Attributes:
        residual: from x (n, 1) to the residuals (m, 1).
        start: (n,) the standard start.
        zero: (n,) a point where every residual is 0, if the paper gives one in closed form.
        scales: by which the standard start is multiplied.
    """

    residual: Callable[[cs.MX], cs.MX]
    start: Array
    zero: Array | None = None
    scales: tuple[int, ...] = SCALES


def _up_to(m: int) -> cs.DM:
    return cs.DM(np.arange(1.0, m + 1))


def powell_badly_scaled(x: cs.MX) -> cs.MX:  # 3
    return cs.vertcat(1e4 * x[0] * x[1] - 1, cs.exp(-x[0]) + cs.exp(-x[1]) - 1.0001)


def brown_badly_scaled(x: cs.MX) -> cs.MX:  # 4
    return cs.vertcat(x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2)


def beale(x: cs.MX) -> cs.MX:  # 5
    return cs.vertcat(*(y - x[0] * (1 - x[1] ** (i + 1)) for i, y in enumerate((1.5, 2.25, 2.625))))


def gaussian(x: cs.MX) -> cs.MX:  # 9
    t = (8 - _up_to(15)) / 2
    y = cs.DM([*GAUSSIAN, *GAUSSIAN[-2::-1]])
    return x[0] * cs.exp(-x[1] * (t - x[2]) ** 2 / 2) - y


def gulf(x: cs.MX) -> cs.MX:  # 11, with |y - x2| where the paper has a misprint
    t = np.arange(1.0, 100) / 100
    y = 25 + (-50 * np.log(t)) ** (2 / 3)
    return cs.exp(-(cs.fabs(cs.DM(y) - x[1]) ** x[2]) / x[0]) - cs.DM(t)


def wood(x: cs.MX) -> cs.MX:  # 14
    return cs.vertcat(
        10 * (x[1] - x[0] ** 2),
        1 - x[0],
        np.sqrt(90) * (x[3] - x[2] ** 2),
        1 - x[2],
        np.sqrt(10) * (x[1] + x[3] - 2),
        (x[1] - x[3]) / np.sqrt(10),
    )


def biggs_exp6(x: cs.MX) -> cs.MX:  # 18, m = 13
    t = _up_to(13) / 10
    y = cs.exp(-t) - 5 * cs.exp(-10 * t) + 3 * cs.exp(-4 * t)
    return x[2] * cs.exp(-t * x[0]) - x[3] * cs.exp(-t * x[1]) + x[5] * cs.exp(-t * x[4]) - y


def extended_rosenbrock(x: cs.MX) -> cs.MX:  # 21
    odd, even = x[0::2], x[1::2]
    return cs.vertcat(10 * (even - odd**2), 1 - odd)


def extended_powell(x: cs.MX) -> cs.MX:  # 22
    a, b, c, d = (x[k::4] for k in range(4))
    return cs.vertcat(
        a + 10 * b, np.sqrt(5) * (c - d), (b - 2 * c) ** 2, np.sqrt(10) * (a - d) ** 2
    )


def penalty_1(x: cs.MX) -> cs.MX:  # 23
    return cs.vertcat(np.sqrt(1e-5) * (x - 1), cs.sumsqr(x) - 0.25)


def penalty_2(x: cs.MX) -> cs.MX:  # 24
    n = x.shape[0]
    i = np.arange(2.0, n + 1)
    y = np.exp(i / 10) + np.exp((i - 1) / 10)
    e = cs.exp(x / 10)
    return cs.vertcat(
        x[0] - 0.2,
        np.sqrt(1e-5) * (e[1:] + e[: n - 1] - cs.DM(y)),
        np.sqrt(1e-5) * (e[1:] - np.exp(-0.1)),
        cs.dot(cs.DM(np.arange(n, 0.0, -1)), x**2) - 1,
    )


def variably_dimensioned(x: cs.MX) -> cs.MX:  # 25
    s = cs.dot(_up_to(x.shape[0]), x - 1)
    return cs.vertcat(x - 1, s, s**2)


def trigonometric(x: cs.MX) -> cs.MX:  # 26
    n = x.shape[0]
    return n - cs.sum1(cs.cos(x)) + _up_to(n) * (1 - cs.cos(x)) - cs.sin(x)


def discrete_boundary(x: cs.MX) -> cs.MX:  # 28
    n = x.shape[0]
    h = 1 / (n + 1)
    before, after = cs.vertcat(0, x[: n - 1]), cs.vertcat(x[1:], 0)
    return 2 * x - before - after + h**2 * (x + h * _up_to(n) + 1) ** 3 / 2


def discrete_integral(x: cs.MX) -> cs.MX:  # 29
    n = x.shape[0]
    t = np.arange(1.0, n + 1) / (n + 1)
    green = np.minimum.outer(t, t) * (1 - np.maximum.outer(t, t))
    return x + cs.DM(green) @ (x + cs.DM(t) + 1) ** 3 / (2 * (n + 1))


def broyden_tridiagonal(x: cs.MX) -> cs.MX:  # 30
    n = x.shape[0]
    before, after = cs.vertcat(0, x[: n - 1]), cs.vertcat(x[1:], 0)
    return (3 - 2 * x) * x - before - 2 * after + 1


def broyden_banded(x: cs.MX) -> cs.MX:  # 31
    n = x.shape[0]
    i, j = np.mgrid[:n, :n]
    band = ((j >= i - 5) & (j <= i + 1) & (j != i)).astype(float)
    return x * (2 + 5 * x**2) + 1 - cs.DM(band) @ (x * (1 + x))


def _grid(n: int) -> Array:
    t = np.arange(1.0, n + 1) / (n + 1)
    return t * (t - 1)


def _points(*numbers: float) -> Array:
    return np.array(numbers, dtype=float)


FUNCTIONS: Mapping[str, Function] = {
    "powell-badly-scaled": Function(powell_badly_scaled, _points(0, 1)),
    "brown-badly-scaled": Function(brown_badly_scaled, _points(1, 1), _points(1e6, 2e-6)),
    "beale": Function(beale, _points(1, 1), _points(3, 0.5)),
    "gaussian": Function(gaussian, _points(0.4, 1, 0)),
    # ten times its start is the answer
    "gulf": Function(gulf, _points(5, 2.5, 0.15), _points(50, 25, 1.5), (1, 100)),
    "wood": Function(wood, _points(-3, -1, -3, -1), np.ones(4)),
    "biggs-exp6": Function(biggs_exp6, _points(1, 2, 1, 1, 1, 1), _points(1, 10, 1, 5, 4, 3)),
    "extended-rosenbrock": Function(extended_rosenbrock, np.tile([-1.2, 1.0], 5), np.ones(10)),
    "extended-powell": Function(extended_powell, np.tile([3.0, -1.0, 0.0, 1.0], 3), np.zeros(12)),
    "penalty-1": Function(penalty_1, np.arange(1.0, 11)),
    "penalty-2": Function(penalty_2, np.full(10, 0.5)),
    "variably-dimensioned": Function(
        variably_dimensioned, 1 - np.arange(1.0, 11) / 10, np.ones(10)
    ),
    "trigonometric": Function(trigonometric, np.full(10, 0.1), np.zeros(10)),
    "discrete-boundary": Function(discrete_boundary, _grid(10)),
    "discrete-integral": Function(discrete_integral, _grid(10)),
    "broyden-tridiagonal": Function(broyden_tridiagonal, np.full(10, -1.0)),
    "broyden-banded": Function(broyden_banded, np.full(10, -1.0)),
}
ZERO = "a point where every residual is 0"


def mgh(function: str = "wood", scale: float = 1.0) -> Setup:
    """A function of the paper, begun at its standard start times `scale`."""
    one = FUNCTIONS[function]
    source = SOURCE if one.zero is None else f"{SOURCE}: {ZERO}"
    begun = PublishedFunction(one.residual, scale * one.start, source, one.zero)
    return begun.setup(f"mgh-{function}")


MGH: tuple[Case, ...] = tuple(
    case(f"mgh-{name}", "mgh", mgh, {"function": name, "scale": float(scale)}, f"start x {scale}")
    for name, one in FUNCTIONS.items()
    for scale in one.scales
)
