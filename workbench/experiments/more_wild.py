"""Moré and Wild's problems: 22 sums of squares in several sizes, from near and far starts.

Minimise 1/2 |f(x)|^2; the set P of Benchmarking derivative-free optimization algorithms (SIAM J.
Optimization 20(1), 2009, Table 2.1 and the file dfo.dat that goes with it). `far` starts are ten
times the standard ones. Brown's almost linear function with 100 unknowns is the one problem that
optimagic's edition of the set has beside the paper's 53.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.errors import UnknownName, check_known
from workbench.experiments import more_wild_formulas as f
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import check_start
from workbench.fitting.setup import GRADED, KnownAnswer, Measure, Setup
from workbench.problem import Problem
from workbench.residuals import Residual

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
MOVED = 0.1  # of an entry of the standard start, by which random starts lie off


@dataclass(frozen=True)
class Family:
    """One formula in several sizes.

    Attributes:
        residual: the residuals (m, 1) from x (n, 1) and m.
        start: the standard start (n,) for n unknowns.
        sizes: the number m of residuals for each number n of unknowns.
        source: where the best known costs are from.
        answer: the minimum (n,) for n unknowns, where there is only one.
    """

    residual: Callable[[cs.MX, int], cs.MX]
    start: Callable[[int], Array]
    sizes: Mapping[int, int]
    source: str
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
    "linear-full-rank": Family(f.linear_full_rank, filled(1), {9: 45}, BY_ALGEBRA, filled(-1)),
    "linear-rank-one": Family(f.linear_rank_one, filled(1), {7: 35}, BY_ALGEBRA),
    "linear-rank-one-zeros": Family(f.linear_rank_one_zeros, filled(1), {7: 35}, BY_ALGEBRA),
    "rosenbrock": Family(f.rosenbrock, point(-1.2, 1), {2: 2}, BY_FORMULA, filled(1)),
    "helical-valley": Family(f.helical_valley, point(-1, 0, 0), {3: 3}, BY_FORMULA, point(1, 0, 0)),
    "powell-singular": Family(f.powell_singular, point(3, -1, 0, 1), {4: 4}, BY_FORMULA, filled(0)),
    "freudenstein-roth": Family(
        f.freudenstein_roth, point(0.5, -2), {2: 2}, BY_FORMULA, point(5, 4)
    ),
    "bard": Family(f.bard, filled(1), {3: 15}, BY_SEARCH),
    "kowalik-osborne": Family(
        f.kowalik_osborne, point(0.25, 0.39, 0.415, 0.39), {4: 11}, BY_SEARCH
    ),
    "meyer": Family(f.meyer, point(0.02, 4000, 250), {3: 16}, BY_SEARCH),
    "watson": Family(f.watson, filled(0.5), {6: 31, 9: 31, 12: 31}, BY_SEARCH),
    "box": Family(f.box, point(0, 10, 20), {3: 10}, BY_FORMULA),
    "jennrich-sampson": Family(f.jennrich_sampson, point(0.3, 0.4), {2: 10}, BY_SEARCH),
    "brown-dennis": Family(f.brown_dennis, point(25, 5, -5, -1), {4: 20}, BY_SEARCH),
    "chebyquad": Family(f.chebyquad, evenly, {n: n for n in range(6, 12)}, BY_SEARCH),
    "brown-almost-linear": Family(
        f.brown_almost_linear, filled(0.5), {10: 10, 100: 100}, BY_FORMULA
    ),
    "osborne-1": Family(f.osborne_1, point(0.5, 1.5, 1, 0.01, 0.02), {5: 33}, BY_SEARCH),
    "osborne-2": Family(f.osborne_2, point(*OSBORNE_2_START), {11: 65}, BY_SEARCH),
    "bdqrtic": Family(f.bdqrtic, filled(1), {8: 8, 10: 12, 11: 14, 12: 16}, BY_SEARCH),
    "cube": Family(f.cube, filled(0.5), {n: n for n in (5, 6, 8)}, BY_FORMULA, filled(1)),
    "mancino": Family(f.mancino, f.mancino_start, {n: n for n in (5, 8, 10, 12)}, BY_SEARCH),
    "heart": Family(f.heart, point(*HEART_START), {8: 8}, BY_SEARCH),
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
    moved = MOVED * np.random.default_rng(start).standard_normal(n) if start else np.zeros(n)
    away = scale * (standard + moved * np.where(standard == 0, 1.0, np.abs(standard)))
    answer = None if family.answer is None else {"x": family.answer(n)}
    problem = Problem((Residual(function, family.residual(x.symbol, m), 1.0),), ("x",), blocks=(x,))
    least = LEAST.get((function, n), 0.0)

    def measures(values: Values) -> tuple[Measure, ...]:
        return (Measure("above the best known cost", problem.linearize(values).cost - least, "1"),)

    return Setup(
        problem=problem,
        start={"x": away},
        question=f"{function}: {m} residuals of {n} unknowns, as Moré and Wild set it, from "
        f"{scale:g} times the standard start{f', moved (start {start})' if start else ''}. Is "
        "the least sum of squares found?",
        known=KnownAnswer(family.source, least, answer),
        measures=measures,
        compared=GRADED,
    )


def _set() -> tuple[Experiment, ...]:
    """The paper's 53 problems in its order, then the one with 100 unknowns."""
    found = []
    for function, family in FAMILIES.items():
        for n, m in family.sizes.items():
            name = f"{function}-{n}" if len(family.sizes) > 1 else function
            for scale in (1.0,) if NEAR_ONLY & {function, name} else (1.0, 10.0):
                far = "" if scale == 1 else "-far"
                found.append(
                    Experiment(
                        f"more-wild-{name}{far}",
                        more_wild,
                        f"{m} residuals of {n} unknowns{', far start' if far else ''}",
                        {"function": function, "n": n, "scale": scale},
                    )
                )
    return tuple(sorted(found, key=lambda one: one.arguments["n"] == 100))


MORE_WILD = _set()
