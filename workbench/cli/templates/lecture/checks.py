"""Checks of lecture 0, NAME, and the mistakes that they tell apart.

A check calls the student's function and says what is wrong with its answer. A mistake is a whole
wrong answer that somebody will give, with a hint; every check must reject two of them at least.
"""

from collections.abc import Callable

import numpy as np

from workbench.course import check, equal, mistake

# influence


@check("influence", points=1)
def is_a_share_of_the_error(influence: Callable[[int, float], float]) -> None:
    """influence(count, off) is the difference of two means"""
    for count, off in ((10, 0.1), (3, -0.6)):
        readings = np.linspace(1.0, 2.0, count)
        moved = readings.copy()
        moved[0] += off
        expected = moved.mean() - readings.mean()
        equal(influence(count, off), expected, f"influence({count}, {off})")


@mistake("influence", "the mean does not move by the whole error: the other readings hold it")
def moves_by_all_of_it(count: int, off: float) -> float:
    """The wrong answer of somebody who forgets the other readings."""
    return off


@mistake("influence", "this divides by the number of the other readings")
def divides_by_the_others(count: int, off: float) -> float:
    """Its sum is right; it divides by count - 1 in place of count."""
    return off / (count - 1)


# pull


@check("pull", points=1)
def is_the_derivative_of_the_cost(pull: Callable[[float, float], float]) -> None:
    """pull(r, k) is the slope of Huber's cost, on both sides of zero"""
    for r in (0.5, -0.5, 3.0, -3.0):
        equal(pull(r, 1.5), min(max(r, -1.5), 1.5), f"pull({r}, 1.5)")


@mistake("pull", "far from zero the slope has the sign of r")
def forgets_the_sign(r: float, k: float) -> float:
    """Right for positive r."""
    return r if abs(r) <= k else k


@mistake("pull", "this is the slope of the square everywhere: beyond k it must not grow")
def never_bends(r: float, k: float) -> float:
    """That of the mean."""
    return r


@mistake("pull", "this is the cost, and not its derivative")
def gives_the_cost(r: float, k: float) -> float:
    """Not differentiated."""
    return r**2 / 2 if abs(r) <= k else k * abs(r) - k**2 / 2
