"""Where the rows of a derivative are written: into one array, or into parts of several."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array


@dataclass(frozen=True, eq=False)
class Rows:
    """A matrix of `count` rows of which some stand in arrays, and nobody wants the others.

    `parts` are the first row of each array, and the array (rows, columns).
    """

    count: int
    parts: tuple[tuple[int, Array], ...]

    @staticmethod
    def of(target: Array | Rows) -> Rows:
        """Those of one array, or the rows themselves."""
        return target if isinstance(target, Rows) else Rows(len(target), ((0, target),))

    @property
    def whole(self) -> Array | None:
        """The array that holds all of them, if there is one."""
        if len(self.parts) != 1 or len(self.parts[0][1]) != self.count:
            return None
        return self.parts[0][1]

    def room(self, columns: int) -> Array:
        """An array for all rows."""
        return np.empty((self.count, columns))

    def fill(self, found: Array) -> None:
        """Write the rows that are wanted to their places, out of an array of all of them."""
        for first, array in self.parts:
            array[...] = found[first : first + len(array)]


Target = Array | Rows
