"""The chain rule of a sequence: similar frames together, frame by frame."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Block, Layout
from workbench.blocks.functions import TOGETHER, Buffered, Mapped
from workbench.blocks.layout import all_values
from workbench.blocks.points import PointsOfEach, distinct
from workbench.problem.banded import (
    BandOrder,
    BlockMatrix,
    BlockPlaces,
    run_of,
)
from workbench.problem.chain import Chain
from workbench.problem.graph import split
from workbench.problem.naming import blocks_behind, rows_of
from workbench.problem.optimality import RowSupport, half_squared
from workbench.problem.sparsity import SparseSum, columns_of_nonzeros, entries_at, rows_of_nonzeros
from workbench.problem.storage import Matrix, is_sparse
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class _FramePlaces:
    """A frame's free and fixed numbers, and where they stand among those of the sequence."""

    free: Layout
    fixed: Layout
    columns: Index  # (n,) of its free numbers
    given: Index  # (h,) of its fixed numbers

    @property
    def entries(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Which entries of which blocks are free."""
        return tuple((block.name, tuple(block.places)) for block in self.free.blocks)


class _SingleFrame:
    """The residuals of one frame, stacked and whitened, and the points and blocks they read."""

    def __init__(self, residuals: Sequence[Residual]) -> None:
        self.stacked = cs.vertcat(*[residual.whitened for residual in residuals])
        self.points = distinct(p for r in residuals for p in r.points)
        described = [b for r in residuals for b in r.blocks]
        described += [b for p in self.points for b in p.source.blocks]
        self.blocks = blocks_behind(self.stacked, self.points, described)

    def at(self, t: int, free: Layout, fixed: Layout) -> _FramePlaces:
        """The places of the numbers of frame t, given what is free and fixed in the sequence."""
        own: list[Block] = []
        columns = [np.zeros(0, dtype=np.int64)]
        whole: set[str] = set()
        for block in free.blocks:
            if block.name not in self.blocks:
                continue
            one, first = self.blocks[block.name], _first(block.base, t)
            if block.whole is None:
                entries, here = range(one.size), first + np.arange(one.size)
            else:
                places = np.array(block.entries)
                here = np.flatnonzero((places >= first) & (places < first + one.size))
                entries = (places[here] - first).tolist()
            if not len(here):
                continue
            entire = len(here) == one.size
            own.append(one if entire else Block.part(one, entries))
            columns.append(free.slices[block.name].start + here)
            whole |= {block.name} if entire else set()
        left = [block for name, block in self.blocks.items() if name not in whole]
        given = [np.zeros(0, dtype=np.int64)]
        for block in left:
            first = fixed.slices[block.name].start + _first(fixed[block.name], t)
            given.append(np.arange(first, first + block.size))
        return _FramePlaces(
            Layout(tuple(own)), Layout(tuple(left)), np.concatenate(columns), np.concatenate(given)
        )


def _first(block: Block, t: int) -> int:
    """The place where the entries of a frame begin in a block of the sequence."""
    return t * (block.size // block.shape[0]) if block.framed else 0


Places = Sequence[PointsOfEach]  # the points of every source
FRAMES_PER_CALL = 64  # that one call of a CasADi function serves at most
DENSE_ROW = 0.25  # of its entries: a row with more nonzeros is stored with its zeros


class FrameGroup:
    """F frames that have the same chain rule, `chain`; `frames` (F,) are their numbers.

    `rows` (F, m), `columns` (F, n) and `given` (F, h) say where the rows, the free and the fixed
    numbers of each frame stand among those of the sequence.
    """

    def __init__(
        self, chain: Chain, frames: Index, rows: Index, columns: Index, given: Index
    ) -> None:
        self.chain, self.frames = chain, frames
        self.rows, self.columns, self.given = rows, columns, given
        self._mapped: dict[Buffered, Mapped] = {}

    def _of_all(self, one: Buffered, x: Array, fixed: Array, places: Places) -> list[Array]:
        """The function of one frame for all frames, (F, .) for each output.

        CasADi's memory for a call is in proportion to its frames, which are therefore divided
        among calls with equally many.
        """
        arguments = [x[self.columns], fixed[self.given], *(there.points for there in places)]
        if one not in self._mapped:
            F = len(self.frames)
            calls = -(-F // FRAMES_PER_CALL)
            self._mapped[one] = Mapped(one.function, (False,) * len(arguments), -(-F // calls))
        return self._mapped[one](*arguments)

    def residual(self, x: Array, fixed: Array, places: Places) -> Array:
        """The residuals of the frames, (F, m)."""
        return self._of_all(self.chain.to_residual, x, fixed, places)[0]

    def term_sizes(self, x: Array, fixed: Array, places: Places) -> Array:
        """The sizes of the terms that rows are made of, (F, m); see `Chain.term_sizes`."""
        return self._of_all(self.chain.to_size, x, fixed, places)[0]

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
        return [source.evaluate_each(own, F) for source in self.chain.sources]

    def gradient(self, x: Array, fixed: Array, places: Places) -> tuple[Array, Array]:
        """The residuals (F, m), and the gradients (F, n) of the frames' costs."""
        r, direct, *by_points = self._of_all(self.chain.to_derivative, x, fixed, places)
        chain, g = self.chain, np.zeros(self.columns.shape)
        for own, entries, residual in zip(g, direct, r, strict=True):
            own += chain.by_x.vjp(entries, residual)
        for there, pattern, entries in zip(places, chain.by_points, by_points, strict=True):
            cotangents = [pattern.vjp(own, one) for own, one in zip(entries, r, strict=True)]
            for name, part in there.vjps(np.array(cotangents)).items():
                if name in chain.free.slices:
                    g[:, chain.free.slices[name]] += part
        return r, g

    # The Jacobian: rows that are stored whole, and the entries of others.

    @cached_property
    def whole(self) -> Index:
        """The rows of a frame that read points, or a large part of its free numbers directly."""
        reads = np.bincount(self.chain.by_x.rows, minlength=self.chain.by_x.shape[0])
        by_points = [pattern.rows for pattern in self.chain.by_points]
        full = np.flatnonzero(reads > DENSE_ROW * self.chain.by_x.shape[1])
        return np.unique(np.concatenate([full, *by_points])).astype(np.int64)

    @cached_property
    def _into(self) -> tuple[Mask, Index]:
        """Which single entries are in whole rows, and where each whole row stands in the block."""
        place = np.full(self.chain.by_x.shape[0], -1)
        place[self.whole] = np.arange(len(self.whole))
        return place[self.chain.by_x.rows] >= 0, place

    @property
    def single(self) -> tuple[Index, Index]:
        """Rows and columns (F, l) of the entries that stand alone."""
        alone = ~self._into[0]
        by_x = self.chain.by_x
        return self.rows[:, by_x.rows[alone]], self.columns[:, by_x.columns[alone]]

    def linearize(self, x: Array, fixed: Array, places: Places) -> tuple[Array, Array, Array]:
        """The residuals (F, m), the whole rows (F, k, n), and the single entries (F, l)."""
        r, direct, *by_points = self._of_all(self.chain.to_derivative, x, fixed, places)
        inside, place = self._into
        by_x = self.chain.by_x
        block = np.zeros((len(self.frames), len(self.whole), by_x.shape[1]))
        for i, product in enumerate(self._products):
            for some, found in product.of(places[i], by_points[i]):
                block[some, *product.into] += found
        block[:, place[by_x.rows[inside]], by_x.columns[inside]] += direct[:, inside]
        return r, block, direct[:, ~inside]

    @cached_property
    def _products(self) -> list["_RowProduct"]:
        sources = range(len(self.chain.sources))
        return [_RowProduct(self.chain, i, self._into[1], len(self.frames)) for i in sources]


class _RowProduct:
    """dr/dp dp/dx of one source, for several frames in one product of a sparse matrix."""

    def __init__(self, chain: Chain, source: int, place: Index, count: int) -> None:
        pattern = chain.by_points[source]
        reads = chain.sources[source].reads
        wanted = [(n, at) for n, at in chain.free.slices.items() if n in reads]
        self._wide = pattern.shape[1]  # 3 N
        rows = np.unique(pattern.rows)
        numbered = pattern.matrix(np.arange(1.0, len(pattern.rows) + 1)).tocsr()[rows]
        self._taken = numbered.data.astype(np.int64) - 1
        self._height = len(rows)
        most = min(TOGETHER, count)
        shift = np.arange(most)[:, None]
        self._indices = (numbered.indices + shift * self._wide).ravel()
        lengths = np.tile(np.diff(numbered.indptr), most)
        self._starts = np.concatenate([[0], np.cumsum(lengths)])
        columns = np.concatenate(
            [np.zeros(0, int), *(np.arange(a.start, a.stop) for _, a in wanted)]
        )
        self._columns, self._slices, at = columns, {}, 0
        for name, where in wanted:
            self._slices[name] = slice(at, at := at + where.stop - where.start)
        down, across = run_of(place[rows]), run_of(columns)
        if isinstance(down, np.ndarray) and isinstance(across, np.ndarray):
            down = down[:, None]
        self.into = down, across

    def of(self, there: PointsOfEach, entries: Array) -> Iterator[tuple[slice, Array]]:
        """Some of the frames, and the products (some, rows, columns) of these."""
        k = len(self._columns)
        for first in range(0, len(entries), TOGETHER):
            some = slice(first, min(first + TOGETHER, len(entries)))
            size = some.stop - some.start
            points = np.empty((size, self._wide, k))
            parts = {name: points[:, :, at] for name, at in self._slices.items()}
            there.write_jacobians(some, parts)
            data = entries[some][:, self._taken].ravel()
            shape = size * self._height, size * self._wide
            starts = self._starts[: shape[0] + 1]
            D = csr_array((data, self._indices[: len(data)], starts), shape=shape)
            yield some, (D @ points.reshape(shape[1], k)).reshape(size, self._height, k)


BAND_PER_ENTRY = 8  # numbers of a band for each entry of the Jacobian; of more, most are zero


class FrameChain:
    """Residual, Jacobian and gradient of a problem with residuals of frames.

    Frames with the same residuals and free entries share one chain rule (`FrameGroup`). Other
    residuals, such as those between frames, have a chain rule of the whole problem.
    """

    def __init__(self, residuals: Sequence[Residual], free: Layout, fixed: Layout) -> None:
        self._free, self._fixed = free, fixed
        self._groups, others = _grouped(residuals, free, fixed)
        self._size, rows = sum(r.size for r in residuals), rows_of(residuals)
        none = np.zeros(0, dtype=np.int64)
        at = (np.arange(rows[r.name].start, rows[r.name].stop) for r in others)
        self._rest_rows = np.concatenate([none, *at])
        reads = {name for residual in others for name in residual.reads}
        reads |= {block.name for block in free.blocks if block.whole is not None}  # see Graph.of
        read = [block for block in fixed.blocks if block.name in reads]
        given = (np.arange(fixed.size)[fixed.slices[block.name]] for block in read)
        self._rest_given = np.concatenate([none, *given])
        self._rest = Chain.of(others, free, Layout(tuple(read))) if others else None
        self._last: tuple[tuple[bytes, bytes], list[Places]] = ((b"", b""), [])

    def residual(self, x: Array, fixed: Array) -> Array:
        """The whitened residual, (m,)."""
        return self._gathered(x, fixed, FrameGroup.residual, Chain.residual)

    def term_sizes(self, x: Array, fixed: Array) -> Array:
        """The size of the terms that each row is made of, (m,); see `Chain.term_sizes`."""
        return self._gathered(x, fixed, FrameGroup.term_sizes, Chain.term_sizes)

    def gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,); no Jacobian is formed."""
        cost, g = 0.0, np.zeros(len(x))
        if self._rest is not None:
            cost, g = self._rest.gradient(x, fixed[self._rest_given])
        for group, places in zip(self._groups, self._places(x, fixed), strict=True):
            r, own = group.gradient(x, fixed, places)
            cost += half_squared(r.ravel())
            np.add.at(g, group.columns, own)
        return cost, g

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Matrix]:
        """r (m,) and J (m, n): blocks of frames where it is large, else an array."""
        r, parts, blocks = np.empty(self._size), [], []
        for group, places in zip(self._groups, self._places(x, fixed), strict=True):
            r[group.rows], block, single = group.linearize(x, fixed, places)
            blocks.append(block)
            parts.append(single)
        if self._rest is not None:
            r[self._rest_rows], J = self._rest.linearize(x, fixed[self._rest_given])
            parts.append(entries_at(J, self._rest.pattern))
        at = tuple(BlockPlaces(group.rows[:, group.whole], group.columns) for group in self._groups)
        found = BlockMatrix(self._entries.matrix(parts), tuple(blocks), at, self._order)
        if not self.sparse:
            return r, found.dense
        band = (self._order.reach + 1) * len(self._order.inner)
        return r, found if band <= BAND_PER_ENTRY * self._stored else found.sparse

    @cached_property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by the blocks of its frames, or by its nonzeros."""
        return is_sparse(self._size, self._free.size, self._stored)

    @cached_property
    def _stored(self) -> int:
        """How many entries of the Jacobian are stored by blocks and single entries."""
        whole = sum(g.rows[:, g.whole].size * g.columns.shape[1] for g in self._groups)
        return int(whole) + int(self._entries.pattern.nnz)

    @cached_property
    def pattern(self) -> csc_array:
        """Where the Jacobian can be nonzero, (m, n); points depend on all of their blocks."""
        parts: list[tuple[Index, NDArray[np.signedinteger]]] = []
        for group in self._groups:
            one = group.chain.pattern.tocoo()
            parts.append((group.rows[:, one.row], group.columns[:, one.col]))
        if self._rest is not None:
            one = self._rest.pattern.tocoo()
            parts.append((self._rest_rows[one.row], one.col))
        return SparseSum(parts, (self._size, self._free.size)).pattern

    @cached_property
    def support(self) -> RowSupport:
        """Which rows each free number can change, in frames and in the other residuals."""
        parts = [(g.chain.support, g.rows, g.columns) for g in self._groups]
        if self._rest is not None:
            everything = np.arange(self._free.size)[None]
            parts.append((self._rest.support, self._rest_rows[None], everything))
        return RowSupport.of_frames(parts, (self._free.size, self._size))

    def _gathered(
        self,
        x: Array,
        fixed: Array,
        of_group: Callable[[FrameGroup, Array, Array, Places], Array],
        of_rest: Callable[[Chain, Array, Array], Array],
    ) -> Array:
        found = np.empty(self._size)
        for group, places in zip(self._groups, self._places(x, fixed), strict=True):
            found[group.rows] = of_group(group, x, fixed, places)
        if self._rest is not None:
            found[self._rest_rows] = of_rest(self._rest, x, fixed[self._rest_given])
        return found

    def _places(self, x: Array, fixed: Array) -> list[Places]:
        """The points of every group, source and frame at x; kept for the next call there."""
        last, key = self._last, (x.tobytes(), fixed.tobytes())
        if key != last[0]:
            values = all_values(self._free, x, self._fixed, fixed)
            blocks = {b.base.name: b.base for b in (*self._free.blocks, *self._fixed.blocks)}
            framed = {name: block.framed for name, block in blocks.items()}
            self._last = last = key, [group.places(values, framed) for group in self._groups]
        return last[1]

    # How the Jacobian is put together.

    @cached_property
    def _entries(self) -> SparseSum:
        """The places of the entries that are in no block."""
        parts = [group.single for group in self._groups]
        if self._rest is not None:
            one = self._rest.pattern
            parts.append((self._rest_rows[one.indices], columns_of_nonzeros(one)))
        return SparseSum(parts, (self._size, self._free.size))

    @cached_property
    def _order(self) -> BandOrder:
        return _order(self._free, self._entries.pattern)


def _order(free: Layout, rest: csc_array) -> BandOrder:
    """The order of the unknowns: frame after frame, and the shared ones last.

    `rest` (m, n) are the entries of the Jacobian that couple frames.
    """
    frame_of = np.full(free.size, -1)
    for block in free.blocks:
        if block.base.framed:
            size = block.base.size // block.base.shape[0]
            frame_of[free.slices[block.name]] = np.array(block.places, dtype=np.int64) // size
    inner = np.flatnonzero(frame_of >= 0)
    inner = inner[np.argsort(frame_of[inner], kind="stable")]
    count = max((b.base.shape[0] for b in free.blocks if b.base.framed), default=0)
    edges = np.searchsorted(frame_of[inner], np.arange(count + 1))
    position = np.full(free.size, -1)
    position[inner] = np.arange(len(inner))
    reach = int(np.diff(edges).max(initial=1)) - 1
    by_rows = csr_array(rest)
    at = position[by_rows.indices]
    rows = rows_of_nonzeros(by_rows)[at >= 0]
    at = at[at >= 0]
    if len(at):
        starts = np.flatnonzero(np.diff(rows, prepend=-1))
        spans = np.maximum.reduceat(at, starts) - np.minimum.reduceat(at, starts)
        reach = max(reach, int(spans.max()))
    return BandOrder(inner, np.flatnonzero(frame_of < 0), reach, edges)


def _grouped(
    residuals: Sequence[Residual], free: Layout, fixed: Layout
) -> tuple[list[FrameGroup], list[Residual]]:
    """Groups of similar frames, and the residuals that belong to none of them.

    Where the Jacobian of a single frame is sparse, there are no groups, because its blocks would be
    mostly zeros.
    """
    rows = rows_of(residuals)
    parts: dict[int, list[tuple[Residual, Index]]] = {}  # of each frame, with their rows
    for residual in residuals:
        first = rows[residual.name].start
        for t, one in residual.by_frame:
            parts.setdefault(t, []).append((one, np.arange(first, first + one.size)))
            first += one.size
    known: dict[object, _SingleFrame] = {}
    chains: dict[object, tuple[Chain, list[tuple[int, Index, Index, Index]]]] = {}
    for t in sorted(parts):
        own = tuple(one for one, _ in parts[t])
        key = tuple(map(id, own))
        frame = known[key] = known.get(key) or _SingleFrame(own)
        at = frame.at(t, free, fixed)
        whole = key, at.entries
        if whole not in chains:
            graph = split(frame.stacked, frame.points, at.free, at.fixed)
            chain = Chain(*graph, at.free, at.fixed)
            if chain.sparse or any(
                s.pattern(name) is not None for s in chain.sources for name in s.reads
            ):
                return [], list(residuals)
            chains[whole] = chain, []
        numbers = np.concatenate([r for _, r in parts[t]])
        chains[whole][1].append((t, numbers, at.columns, at.given))
    groups = [
        FrameGroup(chain, *(np.array(each) for each in zip(*members, strict=True)))
        for chain, members in chains.values()
    ]
    return groups, [r for r in residuals if not r.by_frame]
