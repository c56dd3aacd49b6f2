"""The points of sources at the last places where they were asked for."""

from collections.abc import Sequence

from workbench.arrays import Array
from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.layout import Values

Key = tuple[bytes, bytes]  # of a place: its free numbers and the fixed ones


class Visited:
    """The points of several sources, kept for whoever asks again at one of the last two places.

    A solver evaluates a trial, and then asks how large rounding errors are where it came from: the
    points there need not be computed again. What helps to differentiate them is kept at the last
    place alone, because it may be as large as a Jacobian.
    """

    def __init__(self, sources: Sequence[NumericPoints], free: Layout, fixed: Layout) -> None:
        self._sources, self._free, self._fixed = tuple(sources), free, fixed
        self._last: tuple[Key, list[PointsAt]] = ((b"", b""), [])
        self._before: tuple[Key, list[Array]] = self._last[0], []
        self._last_fixed: tuple[bytes | None, Values] = (None, {})

    def at(self, x: Array, fixed: Array) -> Sequence[PointsAt]:
        """Each source's points at the free numbers x and the fixed ones."""
        if not self._sources:
            return ()
        last, key = self._last, (x.tobytes(), fixed.tobytes())  # once: a thread may replace it
        if key == last[0]:
            return last[1]
        around = self._around(key[1], fixed)
        values = around | self._free.unpack(x, around)
        found = [source.evaluate(values) for source in self._sources]
        self._before, self._last = (last[0], [here.points for here in last[1]]), (key, found)
        return found

    def points(self, x: Array, fixed: Array) -> list[Array]:
        """The points alone, (N, 3) of each source."""
        before = self._before
        if self._sources and (x.tobytes(), fixed.tobytes()) == before[0]:
            return before[1]
        return [here.points for here in self.at(x, fixed)]

    def _around(self, key: bytes, fixed: Array) -> Values:
        """The values of fixed blocks, read-only; they are often the same as the last time."""
        last = self._last_fixed
        if key != last[0]:
            values = self._fixed.unpack(fixed)
            for value in values.values():
                value.flags.writeable = False
            self._last_fixed = last = key, values
        return last[1]
