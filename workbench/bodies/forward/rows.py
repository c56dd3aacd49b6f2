"""Where the rows of a derivative are written: into one array, or into parts of several."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array


@dataclass(frozen=True, eq=False)
class Rows:
    """A matrix of `count` rows, of which some stand in arrays and the others are not wanted.

    `parts` are the first row of each array, and the array (rows, columns).
    """

    count: int
    parts: tuple[tuple[int, Array], ...]

    @staticmethod
    def of(target: Array | Rows) -> Rows:
        """All rows of one array; or the rows as they are."""
        return target if isinstance(target, Rows) else Rows(len(target), ((0, target),))

    @property
    def whole(self) -> Array | None:
        """The array that holds all of them, if there is one."""
        if len(self.parts) != 1 or len(self.parts[0][1]) != self.count:
            return None
        return self.parts[0][1]

    def __len__(self) -> int:
        """The number of rows, including those that are not wanted."""
        return self.count


RowTarget = Array | Rows


def write(into: RowTarget, found: Array, scale: Array | float | None) -> None:
    """Write the rows that are wanted, out of an array of all rows, each column times its scale."""
    factor = 1.0 if scale is None else scale
    for first, array in Rows.of(into).parts:
        np.multiply(found[first : first + len(array)], factor, out=array)
