"""Memory for large arrays, which is used again when no array in it is left."""

import weakref
from dataclasses import dataclass, field

import numpy as np

from workbench.arrays import Array

WORTH_KEEPING = 2**20  # bytes: memory for less is quick to get
KEPT = 2  # rooms that wait to be used again: a solver compares two linearizations
LINE = 64  # bytes of a cache line


@dataclass(frozen=True, eq=False)
class Rooms:
    """Rooms for arrays of one size after the other.

    An operating system clears new memory page by page, which for a large Jacobian takes as long as
    computing it. An array's room is free when the array and all views of it are gone. Whoever gets
    a room again finds in it what was written there before: hence others can only read it. Arrays of
    less than a megabyte have no room, and are new each time.
    """

    _free: list[Array] = field(default_factory=list)
    _taken: dict[int, weakref.ref[Array]] = field(default_factory=dict)  # by the room

    def array(self, rows: int, columns: int) -> tuple[Array, Array]:
        """An array (rows, columns) to write to, and the same for everybody else to read.

        It holds zeros, or what the last array of this size held. It is free to be used again when
        the second one is gone.
        """
        size = 8 * rows * columns
        if size < WORTH_KEEPING:
            found = np.zeros((rows, columns))
            return found, found
        try:
            room = self._free.pop()  # at once, whatever other threads do
        except IndexError:
            room = _zeros(rows * columns)
        if room.nbytes != size:
            room = _zeros(rows * columns)
        # all views hold it, as its base is no array, and none can be made writeable
        whole = np.frombuffer(memoryview(room.data).toreadonly())
        # it calls back while it is held; `weakref.finalize` takes three times as long
        self._taken[id(room)] = weakref.ref(whole, lambda _: self._back(room))
        return room.reshape(rows, columns), whole.reshape(rows, columns)

    def _back(self, room: Array) -> None:
        del self._taken[id(room)]
        if len(self._free) < KEPT:
            self._free.append(room)


def _zeros(count: int) -> Array:
    """Zeros that begin where a cache line does, as then fewer writes touch two lines.

    For large ones, NumPy asks the system for large pages.
    """
    whole = np.zeros(count + LINE // 8)
    first = -whole.ctypes.data % LINE // 8
    return whole[first : first + count]
