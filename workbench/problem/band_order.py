"""The order in which the unknowns of a sequence make a band, and the places of its entries."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class BandOrder:
    """Which unknowns make the band, and in which order, and which make the border.

    Attributes:
        inner: (N,) the places of the unknowns in the band among all unknowns, frame after frame.
        border: (b,) the places of the shared unknowns among all unknowns.
        reach: the half-width of the band, how far from the diagonal its entries may stand.
        edges: (T + 1,) where the unknowns of each frame begin among those of the band.
    """

    inner: Index
    border: Index
    reach: int
    edges: Index

    @property
    def size(self) -> int:
        """n = N + b, the number of unknowns."""
        return len(self.inner) + len(self.border)

    @cached_property
    def position(self) -> Index:
        """(n,) where each unknown stands among the inner ones; -1 in the border."""
        found = np.full(self.size, -1)
        found[self.inner] = np.arange(len(self.inner))
        return found

    @cached_property
    def in_border(self) -> Index:
        """(n,) where each unknown stands in the border; -1 in the band."""
        found = np.full(self.size, -1)
        found[self.border] = np.arange(len(self.border))
        return found

    def of_frames(self, columns: Index) -> "BandPlaces":
        """The places of matrices of the unknowns `columns` (T, n) of T frames."""
        key = id(columns)
        if key not in self._known:
            self._known[key] = BandPlaces.of(self, columns)
        return self._known[key]

    @cached_property
    def _known(self) -> dict[int, "BandPlaces"]:
        return {}


@dataclass(frozen=True, eq=False)
class BandPlaces:
    """Where the entries of matrices (n, n) of similar frames stand in a banded matrix.

    Attributes:
        columns: (T, n) the unknowns of each frame; kept so that its identity is not reused.
        inner: which of the n unknowns of a frame are in the band, in the order of the band.
        border: which of the n unknowns of a frame are in the border.
        positions: (T, k) where the k unknowns in the band stand in it.
        below: for each of the k unknowns, how far below its diagonal entry the others stand.
        shared: where the unknowns in the border stand in it.
    """

    columns: Index
    inner: Index | slice
    border: Index
    positions: Index
    below: tuple[Index | slice, ...]
    shared: Index

    @staticmethod
    def of(order: BandOrder, columns: Index) -> "BandPlaces":
        """The places for the unknowns `columns` (T, n) of T frames."""
        at = order.position[columns]
        inner, border = np.flatnonzero(at[0] >= 0), np.flatnonzero(at[0] < 0)
        inner = inner[np.argsort(at[0, inner])]
        positions = at[:, inner]
        apart = (positions[:, j:] - positions[:, [j]] for j in range(len(inner)))
        below = tuple(run_of(d[0]) if (d == d[0]).all() else d for d in apart)
        shared = order.in_border[columns[0, border]]
        return BandPlaces(columns, run_of(inner), border, positions, below, shared)

    def put(self, band: Array, between: Array, corner: Array, some: slice, products: Array) -> None:
        """Put the symmetric matrices (T, n, n) of some of the frames into their places.

        `band`, `between` and `corner` are those of a `BandedMatrix`. Frames share places only in
        the corner, where their entries are added.
        """
        by_columns, positions = band.T, self.positions[some]
        own = products[:, self.inner][:, :, self.inner]
        for j, below in enumerate(self.below):
            if isinstance(below, slice):
                by_columns[positions[:, j], below] = own[:, j, j:]
            else:
                rows = below[some] if below.ndim > 1 else below
                by_columns[positions[:, j, None], rows] = own[:, j, j:]
        if self.border.size:
            across = products[:, self.inner][:, :, self.border]
            between[positions[:, :, None], self.shared] = across
            added = products[:, self.border[:, None], self.border].sum(axis=0)
            corner[np.ix_(self.shared, self.shared)] += added


def run_of(places: Index) -> "slice | Index":
    """The places as a slice if they are consecutive, which makes copying faster."""
    if len(places) and np.array_equal(places, places[0] + np.arange(len(places))):
        return slice(int(places[0]), int(places[-1]) + 1)
    return places
