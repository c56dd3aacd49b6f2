"""Similar frames of a sequence: one chain rule, evaluated for all of them at once."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks.functions import TOGETHER, Buffered, Mapped
from workbench.blocks.points import PointsOfEach, points_of_each
from workbench.problem.band_order import run_of
from workbench.problem.chain import Chain

Places = Sequence[PointsOfEach]  # the points of every source
AT_ONCE = TOGETHER  # frames whose points' derivatives are kept at a time, near the processor
MAPPED = 64  # frames that one call of a CasADi function serves at most
FULL = 0.25  # of a row's entries: a row that reads more of its frame is stored with its zeros


class FrameGroup:
    """F frames that have the same chain rule.

    Attributes:
        chain: the chain rule of one frame.
        frames: (F,) the numbers of the frames in the sequence.
        rows: (F, m) where the rows of each frame are among those of the sequence.
        columns: (F, n) where its free numbers are among those of the sequence.
        given: (F, h) where its fixed numbers are among those of the sequence.
    """

    def __init__(
        self, chain: Chain, frames: Index, rows: Index, columns: Index, given: Index
    ) -> None:
        self.chain, self.frames = chain, frames
        self.rows, self.columns, self.given = rows, columns, given
        self._mapped: dict[Buffered, Mapped] = {}

    def _of_all(self, one: Buffered, *arguments: Array) -> list[Array]:
        """The function of one frame for all frames, (F, .) for each output.

        CasADi's memory for a call is in proportion to its frames, which are therefore divided
        among calls with equally many.
        """
        if one not in self._mapped:
            F = len(self.frames)
            calls = -(-F // MAPPED)
            self._mapped[one] = Mapped(one.function, (False,) * len(arguments), -(-F // calls))
        return self._mapped[one](*arguments)

    def residual(self, x: Array, fixed: Array, places: Places) -> Array:
        """The residuals of the frames, (F, m)."""
        return self._of_all(self.chain.to_residual, *self._arguments(x, fixed, places))[0]

    def made_of(self, x: Array, fixed: Array, places: Places) -> Array:
        """The sizes of the terms that rows are made of, (F, m); see `Chain.made_of`."""
        return self._of_all(self.chain.to_size, *self._arguments(x, fixed, places))[0]

    def places(self, values: Mapping[str, Array], framed: Mapping[str, bool]) -> Places:
        """The points of each source in all frames; `framed` blocks have values of every frame."""
        F = len(self.frames)
        own = {
            name: value[self.frames]
            if framed[name]
            else np.broadcast_to(value.copy(), (F, *value.shape))  # a copy: points are lazy
            for name, value in values.items()
            if any(name in source.reads for source in self.chain.sources)
        }
        return [points_of_each(source, own, F) for source in self.chain.sources]

    def gradient(self, x: Array, fixed: Array, places: Places) -> tuple[Array, Array]:
        """The residuals (F, m), and the gradients (F, n) of the frames' costs."""
        r, direct, by_points = self._derived(x, fixed, places)
        chain, g = self.chain, np.zeros(self.columns.shape)
        for own, entries, residual in zip(g, direct, r, strict=True):
            own += chain.by_x.pulled(entries, residual)
        for there, pattern, entries in zip(places, chain.by_points, by_points, strict=True):
            pulls = [pattern.pulled(own, one) for own, one in zip(entries, r, strict=True)]
            for name, part in there.adjoints(np.array(pulls)).items():
                if name in chain.free.slices:
                    g[:, chain.free.slices[name]] += part
        return r, g

    # The Jacobian: rows that are stored whole, and the entries of others.

    @cached_property
    def whole(self) -> Index:
        """The rows of a frame that read points, or a large part of its free numbers directly."""
        reads = np.bincount(self.chain.by_x.rows, minlength=self.chain.by_x.shape[0])
        by_points = [pattern.rows for pattern in self.chain.by_points]
        full = np.flatnonzero(reads > FULL * self.chain.by_x.shape[1])
        return np.unique(np.concatenate([full, *by_points])).astype(np.int64)

    @cached_property
    def _into(self) -> tuple[Mask, Index]:
        """Which single entries are in whole rows, and where each whole row stands in the block."""
        place = np.full(self.chain.by_x.shape[0], -1)
        place[self.whole] = np.arange(len(self.whole))
        return place[self.chain.by_x.rows] >= 0, place

    @property
    def whole_rows(self) -> Index:
        """The numbers (F, k) of the whole rows in the stacked residual."""
        return self.rows[:, self.whole]

    @property
    def single(self) -> tuple[Index, Index]:
        """Rows and columns (F, l) of the entries that stand alone."""
        alone = ~self._into[0]
        by_x = self.chain.by_x
        return self.rows[:, by_x.rows[alone]], self.columns[:, by_x.columns[alone]]

    def linearize(self, x: Array, fixed: Array, places: Places) -> tuple[Array, Array, Array]:
        """The residuals (F, m), the whole rows (F, k, n), and the single entries (F, l)."""
        r, direct, by_points = self._derived(x, fixed, places)
        inside, place = self._into
        by_x = self.chain.by_x
        shape = len(self.frames), len(self.whole), by_x.shape[1]
        first = next(iter(self._products), None)
        whole = first is not None and first.covers == shape[1:]
        block = np.empty(shape) if whole else np.zeros(shape)
        for i, product in enumerate(self._products):
            for some, found in product.of(places[i], by_points[i]):
                if whole and product is first:
                    block[some] = found
                else:
                    block[some, *product.into] += found
        block[:, place[by_x.rows[inside]], by_x.columns[inside]] += direct[:, inside]
        return r, block, direct[:, ~inside]

    @cached_property
    def _products(self) -> list["Product"]:
        _, place = self._into
        return [
            Product(self.chain, i, place, len(self.frames)) for i in range(len(self.chain.sources))
        ]

    def _derived(self, x: Array, fixed: Array, places: Places) -> tuple[Array, Array, list[Array]]:
        derivative = self.chain.to_derivative
        r, direct, *by_points = self._of_all(derivative, *self._arguments(x, fixed, places))
        return r, direct, by_points

    def _arguments(self, x: Array, fixed: Array, places: Places) -> list[Array]:
        return [x[self.columns], fixed[self.given], *(there.points for there in places)]


class Product:
    """dr/dp dp/dx of one source, for several frames in one product of a sparse matrix."""

    def __init__(self, chain: Chain, source: int, place: Index, count: int) -> None:
        pattern = chain.by_points[source]
        reads = chain.sources[source].reads
        self._wanted = [(n, at) for n, at in chain.free.slices.items() if n in reads]
        self._wide = pattern.shape[1]  # 3 N
        rows = np.unique(pattern.rows)
        numbered = pattern.matrix(np.arange(1.0, len(pattern.rows) + 1)).tocsr()[rows]
        self._taken = numbered.data.astype(np.int64) - 1
        self._height = len(rows)
        most = min(AT_ONCE, count)
        shift = np.arange(most)[:, None]
        self._indices = (numbered.indices + shift * self._wide).ravel()
        lengths = np.tile(np.diff(numbered.indptr), most)
        self._starts = np.concatenate([[0], np.cumsum(lengths)])
        columns = np.concatenate(
            [np.zeros(0, int), *(np.arange(a.start, a.stop) for _, a in self._wanted)]
        )
        self._columns, self._rooms, at = columns, {}, 0
        for name, where in self._wanted:
            self._rooms[name] = slice(at, at := at + where.stop - where.start)
        down, across = run_of(place[rows]), run_of(columns)
        if isinstance(down, np.ndarray) and isinstance(across, np.ndarray):
            down = down[:, None]
        self.into = down, across
        straight = isinstance(down, slice) and isinstance(across, slice)
        self.covers = (len(rows), len(columns)) if straight else (0, 0)  # in order, from 0 on

    def of(self, there: PointsOfEach, entries: Array) -> Iterator[tuple[slice, Array]]:
        """Some of the frames, and the products (some, rows, columns) of these."""
        k = len(self._columns)
        for first in range(0, len(entries), AT_ONCE):
            some = slice(first, min(first + AT_ONCE, len(entries)))
            size = some.stop - some.start
            points = np.empty((size, self._wide, k))
            there.tangents(some, {name: points[:, :, at] for name, at in self._rooms.items()})
            data = entries[some][:, self._taken].ravel()
            shape = size * self._height, size * self._wide
            starts = self._starts[: shape[0] + 1]
            D = csr_array((data, self._indices[: len(data)], starts), shape=shape)
            yield some, (D @ points.reshape(shape[1], k)).reshape(size, self._height, k)
