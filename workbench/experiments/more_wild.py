"""Moré and Wild's problems: 22 sums of squares in several sizes, from near and far starts.

Minimise 1/2 |f(x)|^2; the set P of Benchmarking derivative-free optimization algorithms (SIAM J.
Optimization 20(1), 2009, Table 2.1 and the file dfo.dat that goes with it). `far` starts are ten
times the standard ones. Brown's almost linear function with 100 unknowns is the one problem that
optimagic's edition of the set has beside the paper's 53.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from importlib.resources import files
from operator import mul

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.errors import UnknownName, check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import check_start
from workbench.fitting.setup import GRADED, KnownAnswer, Measure, Setup
from workbench.problem import Problem
from workbench.residuals import Residual


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
    moments = (-0.69, -0.044, -1.57, -1.31, -2.65, 2.0, -12.6, 9.48)
    (real, imaginary), t, v = (x[:2], x[2:4]), x[4:6], x[6:]
    rows = []
    for _ in range(4):
        rows += [cs.sum1(real), cs.sum1(imaginary)]
        real, imaginary = real * t - imaginary * v, real * v + imaginary * t
    return cs.vertcat(*rows) - cs.DM(moments)


def mancino_start(n: int) -> Array:
    """A multiple of what the residual is at 0."""
    i = np.arange(1.0, n + 1)
    v = np.sqrt(i[:, None] / i)
    waves = v * (np.sin(np.log(v)) ** 5 + np.cos(np.log(v)) ** 5)
    return np.asarray(-8.710996e-4 * ((i - 50) ** 3 + waves.sum(axis=1)))


BY_FORMULA = "a point where every residual is 0"
BY_ALGEBRA = "linear least squares, in closed form"
BY_SEARCH = "the least of 400 starts, polished; no proof that there is none lower"
# functions, or single sizes of them, of which the set has no far starts
NEAR_ONLY = frozenset(
    [
        "kowalik-osborne",
        "meyer",
        "box",
        "jennrich-sampson",
        "chebyquad",
        "osborne-1",
        "brown-almost-linear",
        "bdqrtic",
        "cube",
        "mancino-8",
        "mancino-10",
    ]
)
START_OFFSET = 0.1  # of an entry of the standard start, by which random starts lie off


@dataclass(frozen=True)
class Family:
    """One formula in several sizes."""

    residual: Callable[[cs.MX, int], cs.MX]  # the residuals (m, 1) from x (n, 1) and m
    start: Callable[[int], Array]  # the standard start (n,) for n unknowns
    sizes: Mapping[int, int]  # the number m of residuals for each number n of unknowns
    source: str  # where the best known costs are from
    # the minimum (n,) for n unknowns, where there is only one
    answer: Callable[[int], Array] | None = None


def point(*numbers: float) -> Callable[[int], Array]:
    """The point whose entries are these numbers."""
    return lambda n: np.array(numbers, dtype=float)


def filled(number: float) -> Callable[[int], Array]:
    """The point (n,) that has the same number in every entry."""
    return lambda n: np.full(n, number)


def evenly(n: int) -> Array:
    """The start whose n entries are spaced evenly inside [0, 1]."""
    return np.arange(1.0, n + 1) / (n + 1)


OSBORNE_2_START = (1.3, 0.65, 0.65, 0.7, 0.6, 3, 5, 7, 2, 4.5, 5.5)
HEART_START = (-0.3, -0.39, 0.3, -0.344, -1.2, 2.69, 1.59, -1.5)
FAMILIES: Mapping[str, Family] = {
    "linear-full-rank": Family(linear_full_rank, filled(1), {9: 45}, BY_ALGEBRA, filled(-1)),
    "linear-rank-one": Family(linear_rank_one, filled(1), {7: 35}, BY_ALGEBRA),
    "linear-rank-one-zeros": Family(linear_rank_one_zeros, filled(1), {7: 35}, BY_ALGEBRA),
    "rosenbrock": Family(rosenbrock, point(-1.2, 1), {2: 2}, BY_FORMULA, filled(1)),
    "helical-valley": Family(helical_valley, point(-1, 0, 0), {3: 3}, BY_FORMULA, point(1, 0, 0)),
    "powell-singular": Family(powell_singular, point(3, -1, 0, 1), {4: 4}, BY_FORMULA, filled(0)),
    "freudenstein-roth": Family(freudenstein_roth, point(0.5, -2), {2: 2}, BY_FORMULA, point(5, 4)),
    "bard": Family(bard, filled(1), {3: 15}, BY_SEARCH),
    "kowalik-osborne": Family(kowalik_osborne, point(0.25, 0.39, 0.415, 0.39), {4: 11}, BY_SEARCH),
    "meyer": Family(meyer, point(0.02, 4000, 250), {3: 16}, BY_SEARCH),
    "watson": Family(watson, filled(0.5), {6: 31, 9: 31, 12: 31}, BY_SEARCH),
    "box": Family(box, point(0, 10, 20), {3: 10}, BY_FORMULA),
    "jennrich-sampson": Family(jennrich_sampson, point(0.3, 0.4), {2: 10}, BY_SEARCH),
    "brown-dennis": Family(brown_dennis, point(25, 5, -5, -1), {4: 20}, BY_SEARCH),
    "chebyquad": Family(chebyquad, evenly, {n: n for n in range(6, 12)}, BY_SEARCH),
    "brown-almost-linear": Family(brown_almost_linear, filled(0.5), {10: 10, 100: 100}, BY_FORMULA),
    "osborne-1": Family(osborne_1, point(0.5, 1.5, 1, 0.01, 0.02), {5: 33}, BY_SEARCH),
    "osborne-2": Family(osborne_2, point(*OSBORNE_2_START), {11: 65}, BY_SEARCH),
    "bdqrtic": Family(bdqrtic, filled(1), {8: 8, 10: 12, 11: 14, 12: 16}, BY_SEARCH),
    "cube": Family(cube, filled(0.5), {n: n for n in (5, 6, 8)}, BY_FORMULA, filled(1)),
    "mancino": Family(mancino, mancino_start, {n: n for n in (5, 8, 10, 12)}, BY_SEARCH),
    "heart": Family(heart, point(*HEART_START), {8: 8}, BY_SEARCH),
}
LEAST: Mapping[tuple[str, int], float] = {  # the best known costs, 1/2 |f|^2; the others' are 0
    ("linear-full-rank", 9): 18.0,
    ("linear-rank-one", 7): 595 / 142,  # m (m - 1) / (4 (2 m + 1))
    ("linear-rank-one-zeros", 7): 1324 / 268,  # (m^2 + 3 m - 6) / (4 (2 m - 3))
    ("bard", 3): 0.004107438653289475,
    ("kowalik-osborne", 4): 0.00015375280192461807,
    ("meyer", 3): 43.97292758512366,
    ("watson", 6): 0.0011438350267761457,
    ("watson", 9): 6.99880069e-7,
    ("watson", 12): 2.36119055e-10,
    ("jennrich-sampson", 2): 62.18109117780742,
    ("brown-dennis", 4): 42911.10081317819,
    ("chebyquad", 8): 0.0017584368628389578,
    ("chebyquad", 10): 0.002386356848187669,
    ("chebyquad", 11): 0.001399880775932875,
    ("osborne-1", 5): 2.7324473487411644e-5,
    ("osborne-2", 11): 0.020068868146773843,
    ("bdqrtic", 8): 5.119486710658716,
    ("bdqrtic", 10): 9.140580876796767,
    ("bdqrtic", 11): 11.130295867441877,
    ("bdqrtic", 12): 13.136383198396981,
}


def more_wild(
    function: str = "rosenbrock", n: int = 2, scale: float = 1.0, start: int = 0
) -> Setup:
    """A function of n unknowns, begun at its standard start times `scale`.

    For `start` k > 0 every entry of that is moved at random by a tenth of itself in the mean
    square (of 1 where it is 0), in the same way for every solver. Raises UnknownName or
    BadArgument.
    """
    check_known("function", function, FAMILIES)
    family = FAMILIES[function]
    if n not in family.sizes:
        sizes = ", ".join(map(str, family.sizes))
        raise UnknownName(f"number of unknowns of {function}", str(n), hint=sizes)
    check_start(start)
    m = family.sizes[n]
    x = Block("x", (n,), labels=tuple(f"x{i + 1}" for i in range(n)))
    standard = family.start(n)
    noise = np.random.default_rng(start).standard_normal(n) if start else np.zeros(n)
    scales = np.where(standard == 0, 1.0, np.abs(standard))
    start_point = scale * (standard + START_OFFSET * noise * scales)
    answer = None if family.answer is None else {"x": family.answer(n)}
    problem = Problem((Residual(function, family.residual(x.symbol, m), 1.0),), ("x",), blocks=(x,))
    least = LEAST.get((function, n), 0.0)

    def measures(values: Values) -> tuple[Measure, ...]:
        return (Measure("above the best known cost", problem.linearize(values).cost - least, "1"),)

    return Setup(
        problem=problem,
        start={"x": start_point},
        question=f"{function}: {m} residuals of {n} unknowns, as Moré and Wild set it, from "
        f"{scale:g} times the standard start{f', moved (start {start})' if start else ''}. Is "
        "the least sum of squares found?",
        known=KnownAnswer(family.source, least, answer),
        measures=measures,
        compared=GRADED,
    )


def _set() -> tuple[Experiment, ...]:
    """The paper's 53 problems in its order, then the one with 100 unknowns."""
    experiments = []
    for function, family in FAMILIES.items():
        for n, m in family.sizes.items():
            name = f"{function}-{n}" if len(family.sizes) > 1 else function
            for scale in (1.0,) if NEAR_ONLY & {function, name} else (1.0, 10.0):
                far = "" if scale == 1 else "-far"
                experiments.append(
                    Experiment(
                        f"more-wild-{name}{far}",
                        more_wild,
                        f"{m} residuals of {n} unknowns{', far start' if far else ''}",
                        {"function": function, "n": n, "scale": scale},
                    )
                )
    return tuple(sorted(experiments, key=lambda member: member.arguments["n"] == 100))


MORE_WILD = _set()
