"""Which unknowns the residual noticed along a run, and which of them it has lost."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from workbench.problem import Linearization
from workbench.problem.rounding import Rounding, Support

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Sight:
    """The longest column |J_i| of each unknown that a run met, and the point where it met it."""

    def __init__(self, n: int) -> None:
        self._longest = np.zeros(n)
        self._where: list[Array] = []
        self._met_at = np.zeros(n, dtype=np.int64)

    def see(self, x: Array, here: Linearization) -> None:
        """Another point of the run."""
        longer = here.column_norms > self._longest
        if longer.any():
            self._longest[longer] = here.column_norms[longer]
            self._met_at[longer] = len(self._where)
            self._where.append(x.copy())

    @property
    def never(self) -> Mask:
        """The unknowns that no residual noticed anywhere, (n,)."""
        return np.asarray(self._longest == 0)

    def lost(
        self,
        x: Array,
        start: Array,
        here: Linearization,
        support: Support,
        rounding: Rounding,
        linearize: Callable[[Array], Linearization],
    ) -> Mask:
        """The unknowns that the residual noticed on the way and no longer does, (n,).

        No longer: moving x_i by its own size, or back to the start, changes the rows that it can
        change by no more than rounding. Only those count whose rows are not zero, of the rows that
        x_i changed where its column was longest: where they are, as for a penalty that is no longer
        in force, x_i has nothing more to gain.
        """
        size = np.maximum(np.abs(x), np.abs(x - start))
        error = support.norms(rounding.rows)
        gone = (here.column_norms * size <= error) & (self._longest * size > error)
        found = np.zeros_like(gone)
        for k in np.unique(self._met_at[gone]):
            there = linearize(self._where[k])
            for i in np.flatnonzero(gone & (self._met_at == k)):
                changed = there.jacobian[:, i] != 0
                found[i] = (np.abs(here.residual[changed]) > rounding.rows[changed]).any()
        return found
