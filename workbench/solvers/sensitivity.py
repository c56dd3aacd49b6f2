"""Which unknowns the residual noticed along a run, and which of them it has lost."""

from collections.abc import Callable

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem import Linearization
from workbench.problem.rounding import Rounding, Support, fall

NUDGE = 1e-3  # of the size of an unknown: far enough for its own curvature to show


class Sensitivity:
    """The longest column |J_i| of each unknown that a run met."""

    def __init__(self, n: int) -> None:
        self._longest = np.zeros(n)

    def observe(self, here: Linearization) -> None:
        """Another point of the run."""
        self._longest = np.maximum(self._longest, here.column_norms)

    @property
    def never(self) -> Mask:
        """The unknowns whose column was zero wherever a Jacobian was asked for, (n,)."""
        return np.asarray(self._longest == 0)

    def gone(
        self, x: Array, start: Array, here: Linearization, support: Support, rounding: Rounding
    ) -> Mask:
        """The unknowns whose column was noticed on the way and is zero to rounding at x, (n,).

        Zero: moving x_i by its own size, or back to the start, changes the rows that it can
        change by no more than their rounding errors.
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
    """Those of the `gone` that took a residual with them, (n,).

    Not lost are those whose rows at the start, where their columns were not zero, have become
    zero, as the rows of a penalty that is no longer in force: nothing more is to be gained by
    them. Nor are those that the residual notices a little to both sides: there the cost rises, and
    the column is zero because this is their minimum.
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
