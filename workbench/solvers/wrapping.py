"""Rotation vectors of more than half a turn, replaced by shorter ones of the same rotation.

At a full turn the exponential map has rank 1: only steps along the vector change the rotation. A
vector is replaced between iterations, unless the cost would rise or a bound forbids it.
"""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array
from workbench.geometry.rotation import wrapped_to_pi
from workbench.problem import Problem

BEYOND = np.pi * (1 + 1e-6)  # at half a turn exactly there are two, and no reason to change


def rewrapped(problem: Problem, x: Array, is_free: Callable[[Array], bool]) -> Array:
    """The point x (n,) with rotation vectors of at most half a turn, where that `is_free`.

    All joints that are turned by more than pi are changed at once. If that is not free, they are
    changed one after the other, where each change is free. No change leaves the bounds. Without any
    change the result is the array x itself.
    """
    turns = _shorter(problem, x)
    together = x.copy()
    for at, short in turns:
        together[at] = short
    if len(turns) > 1 and is_free(together):
        return together
    for at, short in turns:
        one = x.copy()
        one[at] = short
        if is_free(one):
            x = one
    return x


def _shorter(problem: Problem, x: Array) -> list[tuple[slice, Array]]:
    """The places of joints that are turned by more than pi, and their shorter vectors."""
    first = np.array([at.start for at in problem.rotations], dtype=np.int64)
    if not first.size:
        return []
    angles = np.linalg.norm(x[first[:, None] + np.arange(3)], axis=1)
    found = []
    for start in first[angles > BEYOND]:
        at = slice(int(start), int(start) + 3)
        short = wrapped_to_pi(x[at])
        if (problem.lower[at] <= short).all() and (short <= problem.upper[at]).all():
            found.append((at, short))
    return found
