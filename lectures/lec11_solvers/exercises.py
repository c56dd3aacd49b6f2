"""Exercises of lecture 11, solvers compared.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
`times` are efforts, a row for each problem and a column for each solver; np.inf where a solver never
met the target. Then

    workbench lecture check 11 lec11_solvers.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def target(start: float, best: float, tau: float) -> float:
    """The cost that a run has to come down to, to meet the target tau.

    start is the cost at the start, best the lowest that is known, tau a share -> a cost
    """
    raise Unsolved("target")


def effort_until(costs: Array, efforts: Array, goal: float) -> float:
    """The effort at which a run first visits a point that costs at most `goal`; np.inf if it never does.

    costs (k,) along the run, which may rise again; efforts (k,) spent by then -> an effort
    """
    raise Unsolved("effort_until")


def ratios(times: Array) -> Array:
    """What each solver needed over the least that any of them did, problem by problem.

    np.inf where a solver failed, also on a problem where all of them did.

    times (P, S) above 0 -> (P, S)
    """
    raise Unsolved("ratios")


def profile(times: Array, alphas: Array) -> Array:
    """Performance profiles: the share of all problems on which a solver's ratio is at most alpha.

    times (P, S) above 0, alphas (A,) from 1 on -> (A, S), shares from 0 to 1
    """
    raise Unsolved("profile")


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval (z = 1.96) of a share.

    successes from 0 to trials, trials at least 1 -> two shares, low and high
    """
    raise Unsolved("wilson")


def turned_round() -> Array:
    """Efforts of three solvers A, B and C on five problems, that turn the order of A and B round.

    Among the three, A must be the quickest on more problems than B. Without C, B must be the quickest
    on more problems than A. All efforts are finite and above 0, and no two on one problem are equal.

    -> (5, 3), columns A, B, C
    """
    raise Unsolved("turned_round")
