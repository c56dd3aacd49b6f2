"""Which unknowns changed the residual along a run, and which of them no longer do at its end."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization
from workbench.problem.rounding import Rounding, Support, fall

NUDGE = 1e-3  # of the size of an unknown: far enough for its own curvature to show


class Sensitivity:
    """The longest column |J_i| of each unknown at the points of a run, and how far it moved."""

    def __init__(self, start: Array) -> None:
        self._longest = np.zeros(start.size)
        self._least, self._most = start.copy(), start.copy()

    def observe(self, x: Array, here: Linearization) -> None:
        """Record the columns at another point of the run."""
        self._longest = np.maximum(self._longest, here.column_norms)
        self._least, self._most = np.minimum(self._least, x), np.maximum(self._most, x)

    @property
    def never(self) -> Mask:
        """The unknowns (n,) whose column was zero at all points."""
        return np.asarray(self._longest == 0)

    def size(self, x: Array) -> Array:
        """The size of each unknown (n,) at x: its own, or how far it was from there on the way."""
        return np.asarray(np.maximum(np.abs(x), np.maximum(self._most - x, x - self._least)))

    def noticed(self, x: Array, error: Array) -> Mask:
        """The unknowns (n,) that changed the residual at some point by more than `error` (n,).

        This means that their longest column times their size at x is larger.
        """
        return np.asarray(self._longest * self.size(x) > error)

    def gone(self, x: Array, here: Linearization, support: Support, rounding: Rounding) -> Mask:
        """The unknowns (n,) whose column is zero to rounding at x, but was not on the way.

        A column is zero to rounding if moving x_i by its size changes the rows that it can change
        by no more than their rounding errors. Its size is at least what would have changed these
        rows by their length where it was noticed most: the size of a number near 0 says nothing.
        """
        error, rows = support.norms(rounding.rows), support.norms(here.residual)
        once = np.where(self._longest > 0, self._longest, 1.0)
        size = np.maximum(self.size(x), rows / once)
        return np.asarray((here.column_norms * size <= error) & (self._longest * size > error))


def iterate_since(blind: Callable[[int], bool], last: int) -> int:
    """The first of the iterates 0 to `last` from which on they are `blind`, by bisection.

    The last one is blind. It is 0 if the first one is blind too.
    """
    if blind(0):
        return 0
    seeing, unseeing = 0, last
    while unseeing - seeing > 1:
        k = (seeing + unseeing) // 2
        seeing, unseeing = (seeing, k) if blind(k) else (k, unseeing)
    return unseeing


def lost(
    gone: Mask,
    x: Array,
    size: Array,
    start: Linearization,
    here: Linearization,
    rounding: Rounding,
    residual: Callable[[Array], Array],
) -> Mask:
    """Which of the unknowns that are `gone` (n,) are lost.

    An unknown is not lost if the rows that it changed at the start have become zero, as the rows of
    a penalty that is no longer active: nothing more can be gained from it. Nor is it lost if the
    cost rises a little to both sides of x: then its column is zero because this is the minimum.
    A little is a thousandth of its `size` (n,).
    """
    found = gone.copy()
    for i in np.flatnonzero(gone):
        rows = start.column(int(i)) != 0  # that it changes
        if rows.any() and (np.abs(here.residual[rows]) <= rounding.rows[rows]).all():
            found[i] = False
            continue
        rises = []
        for side in (-1.0, 1.0):
            to = x.copy()
            to[i] += side * NUDGE * size[i]
            there = residual(to)
            noise = rounding.of_fall(here.residual, there != here.residual)
            rises.append(-fall(here.residual, there) > noise)
        found[i] = not all(rises)
    return found
