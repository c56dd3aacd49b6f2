"""Twenty-two sums of squares, from x (n, 1) to residuals (m, 1), and their standard starts.

Formulas and observations: Moré, Garbow and Hillstrom, Testing unconstrained optimization software,
ACM TOMS 7(1), 1981; the last five: Moré and Wild, Benchmarking derivative-free optimization
algorithms, SIAM J. Optimization 20(1), 2009, after CUTEr.
"""

import json
from functools import cache, reduce
from importlib.resources import files
from operator import mul

import casadi as cs
import numpy as np

from workbench.arrays import Array


@cache
def observed(problem: str) -> Array:
    """The observations of a problem, as PROVENANCE.md beside the file describes them."""
    file = files("workbench") / "data" / "more_wild" / "observations.json"
    return np.array(json.loads(file.read_text("utf-8"))[problem], dtype=float)


def up_to(m: int) -> cs.DM:
    """1, 2, ..., m as a column."""
    return cs.DM(np.arange(1.0, m + 1))


def linear_full_rank(x: cs.MX, m: int) -> cs.MX:
    """x_i - s for i up to n, then m - n rows of -s, where s = 2/m sum x + 1."""
    s = 2 / m * cs.sum1(x) + 1
    return cs.vertcat(x, cs.DM.zeros(m - x.shape[0])) - s


def linear_rank_one(x: cs.MX, m: int) -> cs.MX:
    """Row i is i sum_j j x_j - 1."""
    return up_to(m) * cs.dot(up_to(x.shape[0]), x) - 1


def linear_rank_one_zeros(x: cs.MX, m: int) -> cs.MX:
    """(i - 1) sum over 1 < j < n of j x_j, but 0 in the last row; all less 1."""
    n = x.shape[0]
    rows = np.append(np.arange(m - 1.0), 0.0)
    return cs.DM(rows) * cs.dot(up_to(n)[1 : n - 1], x[1 : n - 1]) - 1


def rosenbrock(x: cs.MX, m: int) -> cs.MX:
    """A curved valley."""
    return cs.vertcat(10 * (x[1] - x[0] ** 2), 1 - x[0])


def helical_valley(x: cs.MX, m: int) -> cs.MX:
    """The angle of (x1, x2), in turns from -1/4 to 3/4, is cut along the negative x2-axis."""
    turns = 0.25 - cs.atan2(x[0], x[1]) / (2 * np.pi)
    radius = cs.sqrt(x[0] ** 2 + x[1] ** 2)
    return cs.vertcat(10 * (x[2] - 10 * turns), 10 * (radius - 1), x[2])


def powell_singular(x: cs.MX, m: int) -> cs.MX:
    """Its Jacobian loses two ranks at the answer, 0."""
    return cs.vertcat(
        x[0] + 10 * x[1],
        np.sqrt(5) * (x[2] - x[3]),
        (x[1] - 2 * x[2]) ** 2,
        np.sqrt(10) * (x[0] - x[3]) ** 2,
    )


def freudenstein_roth(x: cs.MX, m: int) -> cs.MX:
    """Two cubics with a root at (5, 4), and a minimum of cost 49/2 that is no root."""
    y = x[1]
    return cs.vertcat(x[0] - 13 + ((5 - y) * y - 2) * y, x[0] - 29 + ((y + 1) * y - 14) * y)


def bard(x: cs.MX, m: int) -> cs.MX:
    """y - (x1 + u / (v x2 + w x3)), u = i, v = 16 - i, w = min(u, v)."""
    u = np.arange(1.0, m + 1)
    v = u[::-1]
    return cs.DM(observed("bard")) - (x[0] + cs.DM(u) / (v * x[1] + np.minimum(u, v) * x[2]))


def kowalik_osborne(x: cs.MX, m: int) -> cs.MX:
    """y - x1 (u^2 + u x2) / (u^2 + u x3 + x4)."""
    u, y = (cs.DM(column) for column in observed("kowalik-osborne").T)
    return y - x[0] * (u**2 + u * x[1]) / (u**2 + u * x[2] + x[3])


def meyer(x: cs.MX, m: int) -> cs.MX:
    """x1 exp(x2 / (t + x3)) - y, t = 45 + 5 i."""
    return x[0] * cs.exp(x[1] / (45 + 5 * up_to(m) + x[2])) - cs.DM(observed("meyer"))


def watson(x: cs.MX, m: int) -> cs.MX:
    """p'(t) - p(t)^2 - 1 of the polynomial with coefficients x at 29 places, and at 0 twice."""
    n = x.shape[0]
    t = np.arange(1.0, 30.0)[:, None] / 29
    powers = t ** np.arange(n)
    slopes = np.hstack([np.zeros((29, 1)), np.arange(1.0, n) * powers[:, :-1]])
    inside = cs.DM(slopes) @ x - (cs.DM(powers) @ x) ** 2 - 1
    return cs.vertcat(inside, x[0], x[1] - x[0] ** 2 - 1)


def box(x: cs.MX, m: int) -> cs.MX:
    """exp(-t x1) - exp(-t x2) - x3 (exp(-t) - exp(-10 t)), t = i / 10."""
    t = up_to(m) / 10
    return cs.exp(-t * x[0]) - cs.exp(-t * x[1]) - x[2] * (cs.exp(-t) - cs.exp(-10 * t))


def jennrich_sampson(x: cs.MX, m: int) -> cs.MX:
    """2 + 2 i - exp(i x1) - exp(i x2)."""
    i = up_to(m)
    return 2 + 2 * i - cs.exp(i * x[0]) - cs.exp(i * x[1])


def brown_dennis(x: cs.MX, m: int) -> cs.MX:
    """(x1 + t x2 - exp t)^2 + (x3 + x4 sin t - cos t)^2, t = i / 5."""
    t = up_to(m) / 5
    return (x[0] + t * x[1] - cs.exp(t)) ** 2 + (x[2] + x[3] * cs.sin(t) - cs.cos(t)) ** 2


def chebyquad(x: cs.MX, m: int) -> cs.MX:
    """The mean of Chebyshev's T_i over the points 2 x - 1, less its integral over [0, 1]."""
    y = 2 * x - 1
    before, here = cs.MX.ones(x.shape[0]), y
    rows = []
    for i in range(1, m + 1):
        integral = -1 / (i**2 - 1) if i % 2 == 0 else 0.0
        rows.append(cs.sum1(here) / x.shape[0] - integral)
        before, here = here, 2 * y * here - before
    return cs.vertcat(*rows)


def brown_almost_linear(x: cs.MX, m: int) -> cs.MX:
    """x_i + sum x - (n + 1), and the product of all less 1."""
    n = x.shape[0]
    return cs.vertcat((x + cs.sum1(x) - (n + 1))[: n - 1], reduce(mul, cs.vertsplit(x)) - 1)


def osborne_1(x: cs.MX, m: int) -> cs.MX:
    """Two decays over a floor: y - (x1 + x2 exp(-t x4) + x3 exp(-t x5)), t = 10 (i - 1)."""
    t = 10 * (up_to(m) - 1)
    return cs.DM(observed("osborne-1")) - (
        x[0] + x[1] * cs.exp(-t * x[3]) + x[2] * cs.exp(-t * x[4])
    )


def osborne_2(x: cs.MX, m: int) -> cs.MX:
    """A decay and three peaks, t = (i - 1) / 10."""
    t = (up_to(m) - 1) / 10
    peaks = [x[k] * cs.exp(-x[k + 4] * (t - x[k + 7]) ** 2) for k in (1, 2, 3)]
    return cs.DM(observed("osborne-2")) - (x[0] * cs.exp(-x[4] * t) + sum(peaks))


def bdqrtic(x: cs.MX, m: int) -> cs.MX:
    """3 - 4 x_i, then x_i^2 + 2 x_{i+1}^2 + 3 x_{i+2}^2 + 4 x_{i+3}^2 + 5 x_n^2, i to n - 4."""
    n = x.shape[0]
    q = x**2
    squares = sum((k + 1) * q[k : n - 4 + k] for k in range(4)) + 5 * q[n - 1]
    return cs.vertcat(3 - 4 * x[: n - 4], squares)


def cube(x: cs.MX, m: int) -> cs.MX:
    """x1 - 1, then 10 (x_i - x_{i-1}^3)."""
    n = x.shape[0]
    return cs.vertcat(x[0] - 1, 10 * (x[1:] - x[: n - 1] ** 3))


def mancino(x: cs.MX, m: int) -> cs.MX:
    """1400 x_i + (i - 50)^3 + sum_j v (sin^5 log v + cos^5 log v), v^2 = x_i^2 + i / j."""
    n = x.shape[0]
    i = np.arange(1.0, n + 1)
    log = cs.log(cs.repmat(x, 1, n) ** 2 + cs.DM(i[:, None] / i)) / 2  # of v
    waves = cs.exp(log) * (cs.sin(log) ** 5 + cs.cos(log) ** 5)
    return 1400 * x + cs.DM((i - 50) ** 3) + cs.sum2(waves)


def heart(x: cs.MX, m: int) -> cs.MX:
    """The human heart dipole: the first four moments of two dipoles at two places in a plane.

    sum over both of (a + i c) (t + i v)^k is given for k = 0 to 3, x = (a b, c d, t u, v w).
    """
    given = (-0.69, -0.044, -1.57, -1.31, -2.65, 2.0, -12.6, 9.48)
    (real, imaginary), t, v = (x[:2], x[2:4]), x[4:6], x[6:]
    rows = []
    for _ in range(4):
        rows += [cs.sum1(real), cs.sum1(imaginary)]
        real, imaginary = real * t - imaginary * v, real * v + imaginary * t
    return cs.vertcat(*rows) - cs.DM(given)


def mancino_start(n: int) -> Array:
    """A multiple of what the residual is at 0."""
    i = np.arange(1.0, n + 1)
    v = np.sqrt(i[:, None] / i)
    waves = v * (np.sin(np.log(v)) ** 5 + np.cos(np.log(v)) ** 5)
    return np.asarray(-8.710996e-4 * ((i - 50) ** 3 + waves.sum(axis=1)))
