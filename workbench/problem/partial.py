"""Points whose blocks are free in part: derivatives by the free entries alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout, NumericPoints, PointsAt
from workbench.blocks.points import jacobian_of, nonzeros_of, pattern_of

Entries = Mapping[str, Index]


def by_free_entries(source: NumericPoints, free: Layout) -> NumericPoints:
    """The source, with derivatives only by the free entries of its blocks."""
    parts = (block for block in free.parts if block.name in source.reads)
    wanted = {block.name: np.array(block.places) for block in parts}
    if not wanted:
        return source
    only = getattr(source, "only", None)  # a source that can leave out what nobody wants
    found: NumericPoints = only(wanted) if only is not None else PartlyFreePoints(source, wanted)
    return found


@dataclass(frozen=True, eq=False)
class PartlyFreePoints:
    """Points with derivatives by some entries of some blocks; see `NumericPoints`, `SparsePoints`.

    Attributes:
        source: the points with derivatives by whole blocks.
        wanted: the entries of each block that is free in part.
    """

    source: NumericPoints
    wanted: Entries

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the points depend on."""
        return self.source.reads

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points (M, N, 3) m for M values of each block."""
        return self.source.evaluate_batch(values)

    def pattern(self, name: str) -> csc_array | None:
        """The columns of wanted entries in the source's pattern, if it has one."""
        found = pattern_of(self.source, name)
        return None if found is None else _columns(found, self.wanted.get(name))

    def nonzeros(self, name: str) -> int | None:
        """The number that the source gives for the whole block."""
        return nonzeros_of(self.source, name)

    def evaluate(self, values: Mapping[str, Array]) -> "PartlyFreePointsAt":
        """The points where whole blocks have these values."""
        return PartlyFreePointsAt(self.source.evaluate(values), self.wanted, values)


@dataclass(frozen=True, eq=False)
class PartlyFreePointsAt:
    """The points at one set of values; see `PointsAt`, `SparsePointsAt`.

    Attributes:
        here: the points with derivatives by whole blocks.
        wanted: the entries of each block that is free in part.
        values: the values of whole blocks.
    """

    here: PointsAt
    wanted: Entries
    values: Mapping[str, Array]

    @property
    def points(self) -> Array:
        """The points, (N, 3) m."""
        return self.here.points

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """The derivatives, transposed, written to into[block] (wanted entries, 3 N).

        All rows are computed, and the wanted ones are kept.
        """
        rooms = {
            name: np.empty((np.size(self.values[name]), array.shape[1]))
            if name in self.wanted
            else array
            for name, array in into.items()
        }
        self.here.tangent(rooms, scale)
        for name, array in into.items():
            if name in self.wanted:
                array[...] = rooms[name][self.wanted[name]]

    def jacobian(self, name: str) -> csc_array:
        """The derivative by the wanted entries of a block, (3 N, wanted entries)."""
        return _columns(jacobian_of(self.here, name), self.wanted.get(name))

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """The gradient by the wanted entries of each block, flat."""
        found = self.here.adjoint(pull)
        return {n: g[self.wanted[n]] if n in self.wanted else g for n, g in found.items()}


def _columns(matrix: csc_array, wanted: Index | None) -> csc_array:
    return matrix if wanted is None else csc_array(matrix[:, wanted])
