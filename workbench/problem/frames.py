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
from workbench.problem.banded import BandOrder, BlockMatrix, BlockPlaces, run_of
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
    fixed_places: Index  # (h,) of its fixed numbers

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
        free_blocks: list[Block] = []
        columns = [np.zeros(0, dtype=np.int64)]
        entirely_free: set[str] = set()
        for block in free.blocks:
            if block.name not in self.blocks:
                continue
            own_block, start = self.blocks[block.name], _first(block.base, t)
            if block.whole is None:
                entries, inside = range(own_block.size), start + np.arange(own_block.size)
            else:
                places = np.array(block.entries)
                inside = np.flatnonzero((places >= start) & (places < start + own_block.size))
                entries = (places[inside] - start).tolist()
            if not len(inside):
                continue
            all_free = len(inside) == own_block.size
            free_blocks.append(own_block if all_free else Block.part(own_block, entries))
            columns.append(free.slices[block.name].start + inside)
            entirely_free |= {block.name} if all_free else set()
        fixed_blocks = [block for name, block in self.blocks.items() if name not in entirely_free]
        fixed_places = [np.zeros(0, dtype=np.int64)]
        for block in fixed_blocks:
            start = fixed.slices[block.name].start + _first(fixed[block.name], t)
            fixed_places.append(np.arange(start, start + block.size))
        return _FramePlaces(
            Layout(tuple(free_blocks)),
            Layout(tuple(fixed_blocks)),
            np.concatenate(columns),
            np.concatenate(fixed_places),
        )


def _first(block: Block, t: int) -> int:
    """The place where the entries of a frame begin in a block of the sequence."""
    return t * (block.size // block.shape[0]) if block.framed else 0


AllPoints = Sequence[PointsOfEach]  # of every source, in all frames of a group
FRAMES_PER_CALL = 64  # that one call of a CasADi function serves at most
DENSE_ROW = 0.25  # of its entries: a row with more nonzeros is stored with its zeros


class FrameGroup:
    """F frames that have the same chain rule, `chain`; `frames` (F,) are their numbers.

    `rows` (F, m), `columns` (F, n) and `fixed_places` (F, h) say where the rows, the free and the
    fixed numbers of each frame stand among those of the sequence.
    """

    def __init__(
        self, chain: Chain, frames: Index, rows: Index, columns: Index, fixed_places: Index
    ) -> None:
        self.chain, self.frames = chain, frames
        self.rows, self.columns, self.fixed_places = rows, columns, fixed_places
        self._mapped: dict[Buffered, Mapped] = {}

    def _of_all(self, function: Buffered, x: Array, fixed: Array, points: AllPoints) -> list[Array]:
        """The function of one frame for all frames, (F, .) for each output.

        CasADi's memory for a call is in proportion to its frames, which are therefore divided
        among calls with equally many.
        """
        own = x[self.columns], fixed[self.fixed_places]
        arguments = [*own, *(of_source.points for of_source in points)]
        if function not in self._mapped:
            F = len(self.frames)
            calls = -(-F // FRAMES_PER_CALL)
            varying = (False,) * len(arguments)
            self._mapped[function] = Mapped(function.function, varying, -(-F // calls))
        return self._mapped[function](*arguments)

    def residual(self, x: Array, fixed: Array, points: AllPoints) -> Array:
        """The residuals of the frames, (F, m)."""
        return self._of_all(self.chain.to_residual, x, fixed, points)[0]

    def term_sizes(self, x: Array, fixed: Array, points: AllPoints) -> Array:
        """The sizes of the terms that rows are made of, (F, m); see `Chain.term_sizes`."""
        return self._of_all(self.chain.to_size, x, fixed, points)[0]

    def points(self, values: Mapping[str, Array], framed: Mapping[str, bool]) -> AllPoints:
        """The points of each source in all frames; `framed` blocks have values of every frame."""
        F = len(self.frames)
        of_frames = {
            name: value[self.frames]
            if framed[name]
            else np.broadcast_to(value.copy(), (F, *value.shape))  # a copy: points are lazy
            for name, value in values.items()
            if any(name in source.reads for source in self.chain.sources)
        }
        return [source.evaluate_each(of_frames, F) for source in self.chain.sources]

    def gradient(self, x: Array, fixed: Array, points: AllPoints) -> tuple[Array, Array]:
        """The residuals (F, m), and the gradients (F, n) of the frames' costs."""
        r, direct, *by_points = self._of_all(self.chain.to_derivative, x, fixed, points)
        chain, g = self.chain, np.zeros(self.columns.shape)
        for g_frame, entries, r_frame in zip(g, direct, r, strict=True):
            g_frame += chain.by_x.vjp(entries, r_frame)
        for of_source, pattern, entries in zip(points, chain.by_points, by_points, strict=True):
            cotangents = [pattern.vjp(e, r_frame) for e, r_frame in zip(entries, r, strict=True)]
            for name, product in of_source.vjps(np.array(cotangents)).items():
                if name in chain.free.slices:
                    g[:, chain.free.slices[name]] += product
        return r, g

    # The Jacobian: rows that are stored whole, and the entries of others.

    @cached_property
    def whole(self) -> Index:
        """The rows of a frame that read points, or a large part of its free numbers directly."""
        counts = np.bincount(self.chain.by_x.rows, minlength=self.chain.by_x.shape[0])
        by_points = [pattern.rows for pattern in self.chain.by_points]
        dense_rows = np.flatnonzero(counts > DENSE_ROW * self.chain.by_x.shape[1])
        return np.unique(np.concatenate([dense_rows, *by_points])).astype(np.int64)

    @cached_property
    def _whole_places(self) -> tuple[Mask, Index]:
        """Which entries are in whole rows, and where each whole row stands in the block, or -1."""
        place = np.full(self.chain.by_x.shape[0], -1)
        place[self.whole] = np.arange(len(self.whole))
        return place[self.chain.by_x.rows] >= 0, place

    @property
    def single(self) -> tuple[Index, Index]:
        """Rows and columns (F, l) of the entries that stand alone."""
        is_single = ~self._whole_places[0]
        by_x = self.chain.by_x
        return self.rows[:, by_x.rows[is_single]], self.columns[:, by_x.columns[is_single]]

    def linearize(self, x: Array, fixed: Array, points: AllPoints) -> tuple[Array, Array, Array]:
        """The residuals (F, m), the whole rows (F, k, n), and the single entries (F, l)."""
        r, direct, *by_points = self._of_all(self.chain.to_derivative, x, fixed, points)
        in_whole, place = self._whole_places
        by_x = self.chain.by_x
        block = np.zeros((len(self.frames), len(self.whole), by_x.shape[1]))
        for i, row_product in enumerate(self._products):
            for frames, product in row_product.of(points[i], by_points[i]):
                block[frames, *row_product.into] += product
        block[:, place[by_x.rows[in_whole]], by_x.columns[in_whole]] += direct[:, in_whole]
        return r, block, direct[:, ~in_whole]

    @cached_property
    def _products(self) -> list["_RowProduct"]:
        sources = range(len(self.chain.sources))
        place = self._whole_places[1]
        return [_RowProduct(self.chain, i, place, len(self.frames)) for i in sources]


class _RowProduct:
    """dr/dp dp/dx of one source, for several frames in one product of a sparse matrix."""

    def __init__(self, chain: Chain, source: int, place: Index, count: int) -> None:
        pattern = chain.by_points[source]
        reads = chain.sources[source].reads
        blocks = [(name, at) for name, at in chain.free.slices.items() if name in reads]
        self._coordinates = pattern.shape[1]  # 3 N
        rows = np.unique(pattern.rows)
        numbered = pattern.matrix(np.arange(1.0, len(pattern.rows) + 1)).tocsr()[rows]
        self._order = numbered.data.astype(np.int64) - 1
        self._n_rows = len(rows)
        count_at_once = min(TOGETHER, count)
        offsets = np.arange(count_at_once)[:, None]
        self._indices = (numbered.indices + offsets * self._coordinates).ravel()
        lengths = np.tile(np.diff(numbered.indptr), count_at_once)
        self._starts = np.concatenate([[0], np.cumsum(lengths)])
        columns = np.concatenate(
            [np.zeros(0, int), *(np.arange(at.start, at.stop) for _, at in blocks)]
        )
        self._columns, self._slices, stop = columns, {}, 0
        for name, at in blocks:
            self._slices[name] = slice(stop, stop := stop + at.stop - at.start)
        row_places, column_places = run_of(place[rows]), run_of(columns)
        if isinstance(row_places, np.ndarray) and isinstance(column_places, np.ndarray):
            row_places = row_places[:, None]
        self.into = row_places, column_places

    def of(self, points: PointsOfEach, entries: Array) -> Iterator[tuple[slice, Array]]:
        """Some of the frames, and the products (some, rows, columns) of these."""
        k = len(self._columns)
        for first in range(0, len(entries), TOGETHER):
            frames = slice(first, min(first + TOGETHER, len(entries)))
            size = frames.stop - frames.start
            derivatives = np.empty((size, self._coordinates, k))
            parts = {name: derivatives[:, :, at] for name, at in self._slices.items()}
            points.write_jacobians(frames, parts)
            data = entries[frames][:, self._order].ravel()
            shape = size * self._n_rows, size * self._coordinates
            starts = self._starts[: shape[0] + 1]
            D = csr_array((data, self._indices[: len(data)], starts), shape=shape)
            product = D @ derivatives.reshape(shape[1], k)
            yield frames, product.reshape(size, self._n_rows, k)


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
        rest_rows = (np.arange(rows[r.name].start, rows[r.name].stop) for r in others)
        self._rest_rows = np.concatenate([none, *rest_rows])
        reads = {name for residual in others for name in residual.reads}
        reads |= {block.name for block in free.blocks if block.whole is not None}  # see Graph.of
        read = [block for block in fixed.blocks if block.name in reads]
        fixed_places = (np.arange(fixed.size)[fixed.slices[block.name]] for block in read)
        self._rest_fixed = np.concatenate([none, *fixed_places])
        self._rest = Chain.of(others, free, Layout(tuple(read))) if others else None
        self._last: tuple[tuple[bytes, bytes], list[AllPoints]] = ((b"", b""), [])

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
            cost, g = self._rest.gradient(x, fixed[self._rest_fixed])
        for group, points in zip(self._groups, self._points(x, fixed), strict=True):
            r, g_group = group.gradient(x, fixed, points)
            cost += half_squared(r.ravel())
            np.add.at(g, group.columns, g_group)
        return cost, g

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Matrix]:
        """r (m,) and J (m, n): blocks of frames where it is large, else an array."""
        r, single, blocks = np.empty(self._size), [], []
        for group, points in zip(self._groups, self._points(x, fixed), strict=True):
            r[group.rows], block, entries = group.linearize(x, fixed, points)
            blocks.append(block)
            single.append(entries)
        if self._rest is not None:
            r[self._rest_rows], J = self._rest.linearize(x, fixed[self._rest_fixed])
            single.append(entries_at(J, self._rest.pattern))
        places = tuple(BlockPlaces(g.rows[:, g.whole], g.columns) for g in self._groups)
        jacobian = BlockMatrix(self._entries.matrix(single), tuple(blocks), places, self._order)
        if not self.sparse:
            return r, jacobian.dense
        band_size = (self._order.reach + 1) * len(self._order.inner)
        return r, jacobian if band_size <= BAND_PER_ENTRY * self._stored else jacobian.sparse

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
            pattern = group.chain.pattern.tocoo()
            parts.append((group.rows[:, pattern.row], group.columns[:, pattern.col]))
        if self._rest is not None:
            pattern = self._rest.pattern.tocoo()
            parts.append((self._rest_rows[pattern.row], pattern.col))
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
        of_group: Callable[[FrameGroup, Array, Array, AllPoints], Array],
        of_rest: Callable[[Chain, Array, Array], Array],
    ) -> Array:
        gathered = np.empty(self._size)
        for group, points in zip(self._groups, self._points(x, fixed), strict=True):
            gathered[group.rows] = of_group(group, x, fixed, points)
        if self._rest is not None:
            gathered[self._rest_rows] = of_rest(self._rest, x, fixed[self._rest_fixed])
        return gathered

    def _points(self, x: Array, fixed: Array) -> list[AllPoints]:
        """The points of every group, source and frame at x; kept for the next call there."""
        last, key = self._last, (x.tobytes(), fixed.tobytes())
        if key != last[0]:
            values = all_values(self._free, x, self._fixed, fixed)
            blocks = {b.base.name: b.base for b in (*self._free.blocks, *self._fixed.blocks)}
            framed = {name: block.framed for name, block in blocks.items()}
            self._last = last = key, [group.points(values, framed) for group in self._groups]
        return last[1]

    # How the Jacobian is put together.

    @cached_property
    def _entries(self) -> SparseSum:
        """The places of the entries that are in no block."""
        places = [group.single for group in self._groups]
        if self._rest is not None:
            pattern = self._rest.pattern
            places.append((self._rest_rows[pattern.indices], columns_of_nonzeros(pattern)))
        return SparseSum(places, (self._size, self._free.size))

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
    positions = position[by_rows.indices]
    rows = rows_of_nonzeros(by_rows)[positions >= 0]
    positions = positions[positions >= 0]
    if len(positions):
        starts = np.flatnonzero(np.diff(rows, prepend=-1))
        spans = np.maximum.reduceat(positions, starts) - np.minimum.reduceat(positions, starts)
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
        for t, part in residual.by_frame:
            parts.setdefault(t, []).append((part, np.arange(first, first + part.size)))
            first += part.size
    frames: dict[object, _SingleFrame] = {}  # by their residuals
    chains: dict[object, tuple[Chain, list[tuple[int, Index, Index, Index]]]] = {}
    for t in sorted(parts):
        frame_residuals = tuple(part for part, _ in parts[t])
        key = tuple(map(id, frame_residuals))
        frame = frames[key] = frames.get(key) or _SingleFrame(frame_residuals)
        places = frame.at(t, free, fixed)
        key_of_chain = key, places.entries
        if key_of_chain not in chains:
            graph = split(frame.stacked, frame.points, places.free, places.fixed)
            chain = Chain(*graph, places.free, places.fixed)
            if chain.sparse or any(
                s.pattern(name) is not None for s in chain.sources for name in s.reads
            ):
                return [], list(residuals)
            chains[key_of_chain] = chain, []
        numbers = np.concatenate([r for _, r in parts[t]])
        chains[key_of_chain][1].append((t, numbers, places.columns, places.fixed_places))
    groups = [
        FrameGroup(chain, *(np.array(each) for each in zip(*members, strict=True)))
        for chain, members in chains.values()
    ]
    return groups, [r for r in residuals if not r.by_frame]
