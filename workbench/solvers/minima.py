"""Which ends of runs are one minimum, and how sure it is that no other minimum was missed."""

from collections.abc import Sequence
from math import prod

import numpy as np

from workbench.arrays import Array
from workbench.problem import Problem

AS_GOOD = 1e-6  # of the cost: residuals that differ by less, as a cost, are those of one minimum
FAR_ABOVE_ROUNDING = 1e3  # of |r|


def one_minimum(
    problem: Problem, fixed: Array, x: Array, here: Array, there: Array, least: float = 0.0
) -> bool:
    """Whether the residual `here` (m,), which is that at x (n,), and that of another point
    `there` (m,) cannot be told apart.

    1/2 |here - there|^2 is then at most a millionth of their cost, what rounding explains, or
    `least`. So what lies along null directions, or a full turn away, counts as the same minimum.
    """
    rounding = FAR_ABOVE_ROUNDING * problem.rounding(x, fixed, here).norm
    cost = 0.5 * max(float(here @ here), float(there @ there))
    apart = here - there
    return 0.5 * float(apart @ apart) <= AS_GOOD * cost + 0.5 * rounding**2 + least


def clusters(
    problem: Problem, fixed: Array, ends: Sequence[Array], least: float = 0.0
) -> tuple[tuple[int, ...], ...]:
    """The numbers of the ends (n,) that belong to one minimum, for each minimum, in their order.

    Residuals that differ by no more than `least`, as a cost, are those of one minimum.
    """
    residuals = [problem.residual(x, fixed) for x in ends]
    found: list[list[int]] = []
    for k, (x, here) in enumerate(zip(ends, residuals, strict=True)):
        same = (
            members
            for members in found
            if any(one_minimum(problem, fixed, x, here, residuals[j], least) for j in members)
        )
        members = next(same, None)
        if members is None:
            found.append([k])
        else:
            members.append(k)
    return tuple(map(tuple, found))


def all_seen(starts: int, minima: int) -> float:
    """The probability that there are no other minima than those seen.

    Starts are drawn independently; beforehand, every number of minima is equally likely, and
    nothing is known of the sizes of basins. NaN where there are too few starts to tell. Boender
    and Rinnooy Kan, Bayesian stopping rules for multistart global optimization methods, 1987.
    """
    if not starts > minima + 1:
        return np.nan
    return prod((starts - 1 - i) / (starts - 1 + i) for i in range(1, minima + 1))


def further_minima(starts: int, minima: int) -> str:
    """What `all_seen` gives, as a sentence without its capital and its full stop."""
    sure = all_seen(starts, minima)
    if np.isnan(sure):
        return "these are too few starts to say whether there are further minima"
    return f"the probability that there are no further minima is {sure:.2g}"
