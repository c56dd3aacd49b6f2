"""Every two solvers of a comparison from the same starts: who is ahead, and whether by chance."""

from itertools import combinations

import numpy as np

from workbench.arrays import Array
from workbench.comparison.comparison import MAIN, Comparison
from workbench.comparison.statistics import Duel, among, duel

Duels = dict[tuple[str, str], Duel]  # by two names, both ways round


def duels(comparison: Comparison, tau: float = MAIN) -> Duels:
    """All pairs of solvers by effort until a target; the tests are corrected for their number."""
    return _pairs(comparison, comparison.needed(tau))


def surer(comparison: Comparison, tau: float = MAIN) -> Duels:
    """By success alone: a win is a target that only one of them met."""
    return _pairs(comparison, np.where(np.isposinf(comparison.needed(tau)), np.inf, 1.0))


def _pairs(comparison: Comparison, amounts: Array) -> Duels:
    problems, names = [i.problem for i in comparison.comparable], comparison.solvers
    pairs = list(combinations(range(len(names)), 2))
    found = among([duel(amounts[:, i], amounts[:, j], problems) for i, j in pairs])
    both: Duels = {}
    for (i, j), one in zip(pairs, found, strict=True):
        both[names[i], names[j]], both[names[j], names[i]] = one, one.turned
    return both
