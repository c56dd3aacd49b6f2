"""Which unknowns changed the residual along a run, and which of them no longer do at its end."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization
from workbench.problem.rounding import Rounding, Support, fall

NUDGE = 1e-3  # of the size of an unknown: far enough for its own curvature to show


class Sensitivity:
    """The longest column |J_i| of each unknown at the points of a run."""

    def __init__(self, n: int) -> None:
        self._longest = np.zeros(n)

    def observe(self, here: Linearization) -> None:
        """Record the columns at another point of the run."""
        self._longest = np.maximum(self._longest, here.column_norms)

    @property
    def never(self) -> Mask:
        """The unknowns (n,) whose column was zero at all points."""
        return np.asarray(self._longest == 0)

    def gone(
        self, x: Array, start: Array, here: Linearization, support: Support, rounding: Rounding
    ) -> Mask:
        """The unknowns (n,) whose column is zero to rounding at x, but was not on the way.

        A column is zero to rounding if moving x_i by its own size, or back to the start, changes
        the rows that it can change by no more than their rounding errors.
        """
        size = np.maximum(np.abs(x), np.abs(x - start))
        error = support.norms(rounding.rows)
        return np.asarray((here.column_norms * size <= error) & (self._longest * size > error))


def lost(
    gone: Mask,
    x: Array,
    start: Linearization,
    start_x: Array,
    here: Linearization,
    rounding: Rounding,
    residual: Callable[[Array], Array],
) -> Mask:
    """Which of the unknowns that are `gone` (n,) are lost.

    An unknown is not lost if the rows that it changed at the start have become zero, as the rows of
    a penalty that is no longer active: nothing more can be gained from it. Nor is it lost if the
    cost rises a little to both sides of x: then its column is zero because this is the minimum.
    """
    found = gone.copy()
    size = np.maximum(np.abs(x), np.abs(x - start_x))
    for i in np.flatnonzero(gone):
        rows = start.rows_changed_by(int(i))
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
