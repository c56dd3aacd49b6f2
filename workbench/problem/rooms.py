"""Memory for large arrays, which is used again when no array in it is left."""

import weakref
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array

WORTH_KEEPING = 2**20  # bytes: memory for less is quick to get
KEPT = 2  # rooms that wait to be used again: a solver compares two linearizations


@dataclass(frozen=True, eq=False)
class Rooms:
    """Rooms for arrays of one size after the other.

    An operating system clears new memory page by page, which for a large Jacobian takes as long as
    computing it. An array's room is free when the array and all views of it are gone.
    """

    _free: list[Array] = field(default_factory=list)

    def empty(self, rows: int, columns: int) -> Array:
        """An array (rows, columns) of any numbers."""
        size = 8 * rows * columns
        if size < WORTH_KEEPING:
            return np.empty((rows, columns))
        try:
            room = self._free.pop()  # at once, whatever other threads do
        except IndexError:
            room = np.empty(rows * columns)  # for which NumPy asks the system for large pages
        if room.nbytes != size:
            room = np.empty(rows * columns)
        whole = np.frombuffer(room.data)  # which all views hold, as its base is no array
        weakref.finalize(whole, self._back, room).atexit = False
        return whole.reshape(rows, columns)

    def _back(self, room: Array) -> None:
        if len(self._free) < KEPT:
            self._free.append(room)
