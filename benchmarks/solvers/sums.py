"""Sums of squares from the literature, each from its published start and some from farther ones.

- `mgh-`: the problems of Moré, Garbow and Hillstrom, Testing unconstrained optimization software,
  ACM TOMS 7(1), 1981, that Moré and Wild's set, which is the suite `more-wild`, left out, from 1,
  10 and 100 times their starts. Comments have the paper's numbers.
- Small problems from books and papers, collected in A. R. Buckley, Test functions for unconstrained
  minimization (TR 1989CS-3, Dalhousie University, 1989) and in the CUTEst collection (Gould, Orban
  and Toint, Computational Optimization and Applications 60, 2015).
- `chain-`: problems in which each unknown meets a few others, of L. Lukšan, Hybrid methods in large
  sparse nonlinear least squares (J. Optimization Theory and Applications 89, 1996); L. Lukšan and
  J. Vlček, Sparse and partially separable test problems for unconstrained and equality constrained
  optimization (Institute of Computer Science, Prague, 1999); and CUTEst.

Minimised is 1/2 |f(x)|^2; published minima are of |f(x)|^2.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.solvers.case import Case, case, data, entries, one_block
from workbench.arrays import Array
from workbench.fitting.setup import Setup

Residuals = Callable[[cs.MX], cs.MX]


@dataclass(frozen=True, eq=False)
class PublishedFunction:
    """A sum of squares.

    Attributes:
        residual: from x (n, 1) to the residuals (m, 1).
        start: (n,) the published start.
        source: who published it.
        zero: (n,) a point where every residual is 0, where there is one in closed form.
        scales: by which the start is multiplied; a case of each.
    """

    residual: Residuals
    start: ArrayLike
    source: str
    zero: ArrayLike | None = None
    scales: tuple[int, ...] = ()


def observed(problem: str) -> Array:
    """The rows of observations of a problem."""
    return np.array(data("published")[problem], dtype=float)


def _up_to(m: int) -> cs.DM:
    return cs.DM(np.arange(1.0, m + 1))


def _shifted(x: cs.MX, by: int) -> cs.MX:
    """x_(i + by), zero past the ends."""
    n, zeros = x.shape[0], cs.MX.zeros(abs(by))
    return cs.vertcat(x[by:], zeros) if by > 0 else cs.vertcat(zeros, x[: n + by])


# Moré, Garbow and Hillstrom

GAUSSIAN = (0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989)


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
    before, after = _shifted(x, -1), _shifted(x, 1)
    return 2 * x - before - after + h**2 * (x + h * _up_to(n) + 1) ** 3 / 2


def discrete_integral(x: cs.MX) -> cs.MX:  # 29
    n = x.shape[0]
    t = np.arange(1.0, n + 1) / (n + 1)
    green = np.minimum.outer(t, t) * (1 - np.maximum.outer(t, t))
    return x + cs.DM(green) @ (x + cs.DM(t) + 1) ** 3 / (2 * (n + 1))


def broyden_tridiagonal(x: cs.MX) -> cs.MX:  # 30
    before, after = _shifted(x, -1), _shifted(x, 1)
    return (3 - 2 * x) * x - before - 2 * after + 1


def broyden_banded(x: cs.MX) -> cs.MX:  # 31
    n = x.shape[0]
    i, j = np.mgrid[:n, :n]
    band = ((j >= i - 5) & (j <= i + 1) & (j != i)).astype(float)
    return x * (2 + 5 * x**2) + 1 - cs.DM(band) @ (x * (1 + x))


def _grid(n: int) -> Array:
    t = np.arange(1.0, n + 1) / (n + 1)
    return t * (t - 1)


# Books and papers


def dennis_schnabel_a(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2, x[0] + x[1], cs.exp(x[1]) - 1)


def dennis_schnabel_b(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 2, (x[0] - 2) * x[1], x[1] + 1)


def dennis_schnabel_c(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2 + x[1] ** 2 - 2, cs.exp(x[0] - 1) + x[1] ** 3 - 2)


def dennis_schnabel_d(x: cs.MX) -> cs.MX:
    a, b, c = cs.vertsplit(x)
    return cs.vertcat(a**2 + b**3 - c**4, 2 * a * b * c, 2 * a * b - 3 * b * c + a * c)


def dennis_schnabel_e(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0], x[1] + x[1] ** 2, cs.exp(x[2]) - 1)


def dennis_schnabel_f(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(2 * (a + b) ** 2 + (a - b) ** 2 - 8, 5 * a**2 + (b - 3) ** 2 - 9)


def _growing(t: Array, z: Array) -> Residuals:
    """exp(t x3) - x1 exp(t x2) + z, the fits of the OPTIMA manual."""
    return lambda x: cs.exp(cs.DM(t) * x[2]) - x[0] * cs.exp(cs.DM(t) * x[1]) + cs.DM(z)


HATFIELD_D = np.array(
    [
        (0.2, 1.751),
        (0.3, 1.561),
        (0.4, 1.391),
        (0.5, 1.239),
        (0.6, 1.103),
        (0.7, 0.981),
        (0.75, 0.925),
        (0.8, 0.8721),
        (0.85, 0.8221),
        (0.9, 0.7748),
    ]
)


def hatfield_f(x: cs.MX) -> cs.MX:
    t = cs.DM([1.0, 2.0, 3.0])
    return x[0] + x[1] * cs.exp(t * x[2]) - cs.DM([0.032, 0.056, 0.099])


def hatfield_g(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    inner = (x[1 : n - 1] + 1) * (x[: n - 2] + 1 - x[2:])
    products = cs.vertcat(-x[0] * x[1], inner, x[n - 2] * x[n - 1])
    return x - x[12] - 1 + products


def exponential_growth(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(1.0, 11) / 4)
    return x[0] * cs.exp(t * x[1]) - t


def engvall(x: cs.MX) -> cs.MX:
    a, b, c = cs.vertsplit(x)
    return cs.vertcat(
        a**2 + b**2 + c**2 - 1,
        a**2 + b**2 + (c - 2) ** 2 - 1,
        a + b + c - 1,
        a + b - c + 1,
        3 * b**2 + a**3 + (5 * c - a + 1) ** 2 - 36,
    )


def gottfried(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a - 0.1136 * (a + 3 * b) * (1 - a), b + 7.5 * (2 * a - b) * (1 - b))


def hyperbola_circle(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] * x[1] - 1, x[0] ** 2 + x[1] ** 2 - 4)


def recipe(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 5, x[1] ** 2, x[2] / (x[1] - x[0]))


def cluster(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat((a - b**2) * (a - cs.sin(b)), (cs.cos(b) - a) * (b - cs.cos(a)))


def powell_square(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] ** 2, 10 * x[0] / (x[0] + 0.1) + 2 * x[1] ** 2)


def heart_6(x: cs.MX) -> cs.MX:
    """The first moments of the two dipoles are eliminated: sums of a and of c are given."""
    a, c, t, u, v, w = cs.vertsplit(x)
    real, imaginary = cs.vertcat(a, -0.816 - a), cs.vertcat(c, -0.017 - c)
    t, v = cs.vertcat(t, u), cs.vertcat(v, w)
    rows = []
    for _ in range(3):
        real, imaginary = real * t - imaginary * v, real * v + imaginary * t
        rows += [cs.sum1(real), cs.sum1(imaginary)]
    return cs.vertcat(*rows) - cs.DM([-1.826, -0.754, -4.839, -3.259, -14.023, 15.467])


def beam(x: cs.MX) -> cs.MX:
    place, angle, speed = (cs.DM(column) for column in observed("beam").T)
    powers = cs.horzcat(*(place**k for k in range(4)))
    return (powers @ x[:4]) * cs.cos(powers @ x[4:] - angle) - speed


def himmelblau(x: cs.MX) -> cs.MX:
    a, b = (cs.DM(column) for column in observed("himmelblau").T)
    above = x[0] ** 2 + a * x[1] ** 2 + a**2 * x[2] ** 2
    return 100 * (above / (b * (1 + a * x[3] ** 2)) - 1)


def judge(x: cs.MX) -> cs.MX:
    a, b, y = (cs.DM(column) for column in observed("judge").T)
    return x[0] + a * x[1] + b * x[1] ** 2 - y


def devilliers_glasser_1(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(24.0) / 10)

    def model(b: list[cs.MX]) -> cs.MX:
        return b[0] * b[1] ** t * cs.sin(t * b[2] + b[3])

    return model(cs.vertsplit(x)) - model([60.137, 1.371, 3.112, 1.761])


def devilliers_glasser_2(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(16.0) / 10)

    def model(b: list[cs.MX]) -> cs.MX:
        wave = cs.tanh(t * b[2] + cs.sin(t * b[3]))
        return b[0] * b[1] ** t * wave * cs.cos(t * cs.exp(b[4]))

    return model(cs.vertsplit(x)) - model([53.81, 1.27, 3.012, 2.13, 0.507])


def exponentials_of_two(x: cs.MX) -> cs.MX:
    t = cs.DM(np.arange(10.0) / 10)
    return cs.exp(-t * x[0]) - 5 * cs.exp(-t * x[1]) - cs.exp(-t) + 5 * cs.exp(-10 * t)


def schittkowski_308(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a**2 + a * b + b**2, cs.sin(a), cs.cos(b))


def cragg_levy(x: cs.MX) -> cs.MX:
    a, b, c, d = cs.vertsplit(x)
    return cs.vertcat((cs.exp(a) - b) ** 2, 10 * (b - c) ** 3, cs.tan(c - d) ** 2, a**4, d - 1)


def sine_valley(x: cs.MX) -> cs.MX:
    return cs.vertcat(100 * (x[1] - cs.sin(x[0])), x[0] / 2)


def egg_crate(x: cs.MX) -> cs.MX:
    return cs.vertcat(x, 5 * cs.sin(x))


def el_attar(x: cs.MX) -> cs.MX:
    a, b = cs.vertsplit(x)
    return cs.vertcat(a**2 + b - 10, a + b**2 - 7, a**2 + b**3 - 1)


def pole_fit(x: cs.MX) -> cs.MX:
    """Value and two derivatives of a function with a pole; the answer is (1, 3, 2)."""
    a, r, h = cs.vertsplit(x)
    first, second = a * r * h, a * (a + 1) * r * h**2
    return cs.vertcat(
        -second / 2 + first - r * (1 - (1 + h) ** -a) + 8,
        -second + first * (1 - (1 + h) ** (-a - 1)) + 56 / 3,
        -second * (1 - (1 + h) ** (-a - 2)) + 208 / 9,
    )


# Chains


def _blocks(x: cs.MX) -> list[cs.MX]:
    """Five neighbours of every block of three."""
    s = (x.shape[0] - 2) // 3
    return [x[[k + 3 * i for i in range(s)]] for k in range(5)]


def serpentine(x: cs.MX) -> cs.MX:
    before, after = x[:-1], x[1:]
    return cs.vertcat(20 * before / (1 + before**2) - 10 * after, before - 1)


def modified_47(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b),
        c - 1,
        (d - 1) ** 2,
        (e - 1) ** 3,
        d * a**2 + cs.sin(d - e) - 10,
        c**4 * d**2 + b - 20,
    )


def modified_48(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b),
        10 * (b**2 - c),
        (c - d) ** 2,
        (d - e) ** 2,
        a + c + b**2 - 30,
        b + d - c**2 - 10,
        a * e - 10,
    )


def modified_53(x: cs.MX) -> cs.MX:
    a, b, c, d, e = _blocks(x)
    return cs.vertcat(
        10 * (a**2 - b), b + c - 2, d - 1, e - 1, a + 3 * b, c + d - 2 * e, 10 * (b**2 - e)
    )


def trigonometric_exponential(x: cs.MX) -> cs.MX:
    before, here, after = x[: x.shape[0] - 2], x[1:-1], x[2:]
    first = 3 * x[0] ** 3 + 2 * x[1] - 5 + cs.sin(x[0] - x[1]) * cs.sin(x[0] + x[1])
    inner = (
        3 * here**3
        + 2 * after
        - 5
        + cs.sin(here - after) * cs.sin(here + after)
        + 4 * here
        - before * cs.exp(before - here)
        - 3
    )
    last = 4 * x[-1] - x[-2] * cs.exp(x[-2] - x[-1]) - 3
    return cs.vertcat(first, inner, last)


def tridiagonal(x: cs.MX) -> cs.MX:
    before, here, after = x[: x.shape[0] - 2], x[1:-1], x[2:]
    inner = 8 * here * (here**2 - before) - 2 * (1 - here) + 4 * (here - after**2)
    last = 8 * x[-1] * (x[-1] ** 2 - x[-2]) - 2 * (1 - x[-1])
    return cs.vertcat(4 * (x[0] - x[1] ** 2), inner, last)


def singular_broyden(x: cs.MX) -> cs.MX:
    return ((3 - 2 * x) * x - _shifted(x, -1) - 2 * _shifted(x, 1) + 1) ** 2


def chandrasekhar(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    mu = np.arange(1.0, n + 1) / n
    weights = mu[:, None] / (mu[:, None] + mu) / (2 * n)
    return x - 1 - x * (cs.DM(weights) @ x)


def quartic(x: cs.MX) -> cs.MX:
    return cs.vertcat(x[0] - 1, x[0] ** 2 - x[1:] ** 2)


def large_squares(x: cs.MX) -> cs.MX:
    return cs.vertcat(2 * (x**2 - x[0]), x - 1)


def qing(x: cs.MX) -> cs.MX:
    return x**2 - cs.DM(np.arange(1.0, x.shape[0] + 1))


def chained_rosenbrock(x: cs.MX) -> cs.MX:
    return cs.vertcat(10 * (x[1:] - x[:-1] ** 2), 1 - x[:-1])


def error_in_rosenbrock(x: cs.MX) -> cs.MX:
    n = x.shape[0]
    weights = 16 * (1.5 + np.sin(np.arange(2.0, n + 1))) ** 2
    return cs.vertcat(x[:-1] - cs.DM(weights) * x[1:] ** 2, x[1:] - 1)


def oscillating_path(x: cs.MX) -> cs.MX:
    return cs.vertcat((x[0] - 1) / 2, (x[1:] - 2 * x[:-1] ** 2 + 1) * 10)


# All of them

DENNIS = "Dennis and Schnabel 1983"
OPTIMA = "The OPTIMA user manual, Hatfield Polytechnic 1989"
BUCKLEY = "Buckley 1989"
GLASSER = "De Villiers and Glasser 1981"
LUKSAN = "Lukšan 1996"
VLCEK = "Lukšan and Vlček 1999"
CUTEST = "CUTEst"


def _mgh(
    residual: Residuals,
    start: ArrayLike,
    zero: ArrayLike | None = None,
    scales: tuple[int, ...] = (1, 10, 100),
) -> PublishedFunction:
    of = "" if zero is None else ": a point where every residual is 0"
    source = f"Moré, Garbow and Hillstrom 1981{of}"
    return PublishedFunction(residual, start, source, zero, scales)


MGH: Mapping[str, PublishedFunction] = {
    "powell-badly-scaled": _mgh(powell_badly_scaled, (0, 1)),
    "brown-badly-scaled": _mgh(brown_badly_scaled, (1, 1), (1e6, 2e-6)),
    "beale": _mgh(beale, (1, 1), (3, 0.5)),
    "gaussian": _mgh(gaussian, (0.4, 1, 0)),
    # ten times its start is the answer
    "gulf": _mgh(gulf, (5, 2.5, 0.15), (50, 25, 1.5), (1, 100)),
    "wood": _mgh(wood, (-3, -1, -3, -1), np.ones(4)),
    "biggs-exp6": _mgh(biggs_exp6, (1, 2, 1, 1, 1, 1), (1, 10, 1, 5, 4, 3)),
    "extended-rosenbrock": _mgh(extended_rosenbrock, np.tile([-1.2, 1.0], 5), np.ones(10)),
    "extended-powell": _mgh(extended_powell, np.tile([3.0, -1.0, 0.0, 1.0], 3), np.zeros(12)),
    "penalty-1": _mgh(penalty_1, np.arange(1.0, 11)),
    "penalty-2": _mgh(penalty_2, np.full(10, 0.5)),
    "variably-dimensioned": _mgh(variably_dimensioned, 1 - np.arange(1.0, 11) / 10, np.ones(10)),
    "trigonometric": _mgh(trigonometric, np.full(10, 0.1), np.zeros(10)),
    "discrete-boundary": _mgh(discrete_boundary, _grid(10)),
    "discrete-integral": _mgh(discrete_integral, _grid(10)),
    "broyden-tridiagonal": _mgh(broyden_tridiagonal, np.full(10, -1.0)),
    "broyden-banded": _mgh(broyden_banded, np.full(10, -1.0)),
}
PUBLISHED: Mapping[str, PublishedFunction] = {
    "dennis-schnabel-a": PublishedFunction(dennis_schnabel_a, (1, 1), DENNIS, (0, 0)),
    "dennis-schnabel-b": PublishedFunction(dennis_schnabel_b, (1, 1), DENNIS, (2, -1)),
    "dennis-schnabel-c": PublishedFunction(dennis_schnabel_c, (2, 3), DENNIS, (1, 1)),
    "dennis-schnabel-d": PublishedFunction(dennis_schnabel_d, (10, 10, 10), DENNIS, (0, 0, 0)),
    "dennis-schnabel-e": PublishedFunction(dennis_schnabel_e, (2, 3, -8), DENNIS, (0, 0, 0)),
    "dennis-schnabel-f": PublishedFunction(dennis_schnabel_f, (2, 0), DENNIS),
    "hatfield-d": PublishedFunction(_growing(*HATFIELD_D.T), (1, -1, 0), OPTIMA),
    "hatfield-f": PublishedFunction(hatfield_f, (0.1,) * 3, OPTIMA),
    "hatfield-g": PublishedFunction(hatfield_g, (1,) * 25, OPTIMA),
    "exponential-growth": PublishedFunction(exponential_growth, (0, 0), BUCKLEY),
    "engvall": PublishedFunction(engvall, (1, 2, 0), BUCKLEY, (0, 0, 1)),
    "gottfried": PublishedFunction(gottfried, (0.5, 0.5), BUCKLEY, (0, 0)),
    "hyperbola-circle": PublishedFunction(hyperbola_circle, (0, 1), BUCKLEY),
    "recipe": PublishedFunction(recipe, (2, 5, 1), BUCKLEY, (5, 0, 0)),
    "cluster": PublishedFunction(cluster, (0, 0), BUCKLEY),
    "powell-square": PublishedFunction(powell_square, (3, 1), "Powell 1970", (0, 0)),
    "heart-6": PublishedFunction(heart_6, (0, 0, 1, 1, 1, 1), "Dennis, Gay and Vu 1985"),
    "vibrating-beam": PublishedFunction(
        beam, (-3.5, 1, 0, 0, 1.7, 0, 0, 0), "Toint and Montgomery 1993"
    ),
    "himmelblau-32": PublishedFunction(himmelblau, (2.7, 90, 1500, 10), "Himmelblau 1972"),
    "judge": PublishedFunction(judge, (1, 5), "Judge et al. 1985"),
    "devilliers-glasser-1": PublishedFunction(
        devilliers_glasser_1, (2, 2, 2, 2), GLASSER, (60.137, 1.371, 3.112, 1.761)
    ),
    "devilliers-glasser-2": PublishedFunction(
        devilliers_glasser_2, (20, 2, 2, 2, 0.2), GLASSER, (53.81, 1.27, 3.012, 2.13, 0.507)
    ),
    "exponentials-of-two": PublishedFunction(
        exponentials_of_two, (1, 5), "Ampgo benchmark, Gavana 2013", (1, 10)
    ),
    "schittkowski-308": PublishedFunction(schittkowski_308, (3, 0.1), "Schittkowski 1987"),
    "cragg-levy": PublishedFunction(cragg_levy, (1, 2, 2, 2), "Cragg and Levy 1969", (0, 1, 1, 1)),
    "sine-valley": PublishedFunction(sine_valley, (4.712389, -1), "Xiao and Zhou 1992", (0, 0)),
    "egg-crate": PublishedFunction(egg_crate, (1, 2), "Ampgo benchmark, Gavana 2013", (0, 0)),
    "el-attar": PublishedFunction(el_attar, (1, 5), "El-Attar, Vidyasagar and Dutta 1979"),
    "pole-fit": PublishedFunction(pole_fit, (1, 0, 1), "Toint 1993", (1, 3, 2)),
}
CHAINS: Mapping[str, PublishedFunction] = {
    "serpentine": PublishedFunction(serpentine, np.full(20, -0.8), LUKSAN, np.ones(20)),
    "modified-47": PublishedFunction(modified_47, np.full(20, -1.0), LUKSAN),
    "modified-48": PublishedFunction(modified_48, np.full(20, -1.0), LUKSAN),
    "modified-53": PublishedFunction(modified_53, np.full(20, -1.0), LUKSAN),
    "trigonometric-exponential": PublishedFunction(
        trigonometric_exponential, np.zeros(30), VLCEK, np.ones(30)
    ),
    "tridiagonal": PublishedFunction(tridiagonal, np.full(30, 12.0), VLCEK, np.ones(30)),
    "singular-broyden": PublishedFunction(singular_broyden, np.full(30, -1.0), VLCEK),
    "chandrasekhar": PublishedFunction(chandrasekhar, np.ones(20), "Moré 1990"),
    "quartic": PublishedFunction(quartic, np.full(20, 0.1), CUTEST, np.ones(20)),
    "large-squares": PublishedFunction(large_squares, np.full(20, 4.0), CUTEST, np.ones(20)),
    "qing": PublishedFunction(qing, np.ones(20), "Qing 2006", np.sqrt(np.arange(1.0, 21))),
    "chained-rosenbrock": PublishedFunction(
        chained_rosenbrock, np.tile([-1.2, 1.0], 10), "Toint 1978", np.ones(20)
    ),
    "error-in-rosenbrock": PublishedFunction(error_in_rosenbrock, np.full(20, -1.0), "Toint 1978"),
    "oscillating-path": PublishedFunction(
        oscillating_path, np.r_[-1.0, np.ones(4)], "Nesterov; Jarre 2011", np.ones(5)
    ),
}
FUNCTIONS: Mapping[str, PublishedFunction] = {
    **{f"mgh-{name}": one for name, one in MGH.items()},
    **PUBLISHED,
    **{f"chain-{name}": one for name, one in CHAINS.items()},
}


def published(function: str = "mgh-wood", scale: float = 1.0) -> Setup:
    """A function of the tables, begun at its published start times `scale`."""
    one = FUNCTIONS[function]
    start = scale * np.array(one.start, dtype=float)
    zero = None if one.zero is None else np.array(one.zero, dtype=float)
    x = entries("x", start.size)
    return one_block(function, one.residual(x.symbol), x, start, one.source, zero)


def _cases() -> Iterator[Case]:
    for name, one in FUNCTIONS.items():
        family = {"mgh": "mgh", "chain": "chains"}.get(name.partition("-")[0], "published")
        for scale in one.scales:
            arguments = {"function": name, "scale": float(scale)}
            yield case(name, family, published, arguments, f"start x {scale}")
        if not one.scales:
            yield case(name, family, published, {"function": name})


SUMS: tuple[Case, ...] = tuple(_cases())
