"""The points of sources at the last places where they were asked for."""

from collections.abc import Sequence

from workbench.arrays import Array
from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.layout import Values

KEPT = 2  # a solver compares the place where it stands with the one it tries


class Visited:
    """The points of several sources, kept for whoever asks again at one of the last two places.

    A solver evaluates a trial, and then asks how large rounding errors are where it came from: the
    points there need not be computed again.
    """

    def __init__(self, sources: Sequence[NumericPoints], free: Layout, fixed: Layout) -> None:
        self._sources, self._free, self._fixed = tuple(sources), free, fixed
        self._known: tuple[tuple[tuple[bytes, bytes], list[PointsAt]], ...] = ()
        self._last_fixed: tuple[bytes | None, Values] = (None, {})

    def at(self, x: Array, fixed: Array) -> Sequence[PointsAt]:
        """Each source's points at the free numbers x and the fixed ones."""
        if not self._sources:
            return ()
        known, key = self._known, (x.tobytes(), fixed.tobytes())  # once: a thread may replace it
        for place, points in known:
            if place == key:
                return points
        around = self._around(key[1], fixed)
        values = around | self._free.unpack(x, around)
        found = [source.evaluate(values) for source in self._sources]
        self._known = (key, found), *known[: KEPT - 1]
        return found

    def _around(self, key: bytes, fixed: Array) -> Values:
        """The values of fixed blocks, read-only; they are often the same as the last time."""
        last = self._last_fixed
        if key != last[0]:
            values = self._fixed.unpack(fixed)
            for value in values.values():
                value.flags.writeable = False
            self._last_fixed = last = key, values
        return last[1]
