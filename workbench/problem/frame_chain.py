"""The numbers of a sequence: residuals of frames by the chain rule of one frame, which all frames
share, and other residuals by that of the whole problem.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Layout
from workbench.blocks.layout import all_values
from workbench.blocks.points import pattern_of
from workbench.problem.band_order import BandOrder
from workbench.problem.block_matrix import BlockMatrix, BlockPlaces, SparsePlaces, joined
from workbench.problem.chain import Chain
from workbench.problem.frame_group import FrameGroup, Places
from workbench.problem.naming import rows_of
from workbench.problem.nonzeros import columns_of_nonzeros, entries_at, rows_of_nonzeros
from workbench.problem.rounding import Support, half_squared
from workbench.problem.single_frame import SingleFrame
from workbench.problem.storage import Matrix, is_sparse
from workbench.residuals import Residual

WORTH = 8  # numbers of a band for each entry of the Jacobian: of more, most are zero


class FrameChain:
    """Residual, Jacobian and gradient of a problem with residuals of frames.

    Frames that have the same residuals and the same free entries share one chain rule
    (`FrameGroup`). Other residuals, such as those between frames, have a chain rule of the whole
    problem.
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

    def made_of(self, x: Array, fixed: Array) -> Array:
        """The size of the terms that each row is made of, (m,); see `Chain.made_of`."""
        return self._gathered(x, fixed, FrameGroup.made_of, Chain.made_of)

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
            parts.append(entries_at(J, self._rest_pattern))
        rest = self._entries.matrix(parts)
        found = BlockMatrix(rest, tuple(blocks), self._block_places, self._order)
        if not self.sparse:
            return r, found.dense
        return r, found if self._banded else found.sparse

    @cached_property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by the blocks of its frames, or by its nonzeros."""
        return is_sparse(self._size, self._free.size, self._stored)

    @cached_property
    def _stored(self) -> int:
        """How many entries of the Jacobian are stored by blocks and single entries."""
        whole = sum(g.whole_rows.size * g.columns.shape[1] for g in self._groups)
        return int(whole) + len(self._entries.rows)

    @cached_property
    def pattern(self) -> csc_array:
        """Where the Jacobian can be nonzero, (m, n); points depend on all of their blocks."""
        rows, columns = [], []
        for group in self._groups:
            one = group.chain.pattern.tocoo()
            rows.append(group.rows[:, one.row].ravel())
            columns.append(group.columns[:, one.col].ravel())
        if self._rest is not None:
            one = self._rest_pattern.tocoo()
            rows.append(self._rest_rows[one.row])
            columns.append(one.col.astype(np.int64))
        at = np.concatenate(rows), np.concatenate(columns)
        return csc_array((np.ones(len(at[0]), dtype=bool), at), shape=(self._size, self._free.size))

    @cached_property
    def support(self) -> Support:
        """Which rows each free number can change, in frames and in the other residuals."""
        parts = [(g.chain.support, g.rows, g.columns) for g in self._groups]
        shape = self._free.size, self._size
        if self._rest is None:
            return Support.of_frames(parts, csr_array(shape))
        one = self._rest.support.explicit.tocoo()
        rest = csr_array((one.data, (one.row, self._rest_rows[one.col])), shape=shape)
        return Support.of_frames(parts, rest)

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
    def _rest_pattern(self) -> csc_array:
        assert self._rest is not None
        return self._rest.pattern

    @cached_property
    def _entries(self) -> SparsePlaces:
        """The places of the entries that are in no block."""
        parts = [group.single for group in self._groups]
        if self._rest is not None:
            one = self._rest_pattern
            parts.append((self._rest_rows[one.indices], columns_of_nonzeros(one)))
        return joined(parts, (self._size, self._free.size))

    @cached_property
    def _block_places(self) -> tuple[BlockPlaces, ...]:
        return tuple(BlockPlaces(group.whole_rows, group.columns) for group in self._groups)

    @cached_property
    def _order(self) -> BandOrder:
        rest = self._entries.matrix([np.ones(len(self._entries.rows))])
        return _order(self._free, rest)

    @cached_property
    def _banded(self) -> bool:
        """Whether a band is worth it for the normal equations: a wide one is mostly zeros."""
        return bool((self._order.reach + 1) * len(self._order.inner) <= WORTH * self._stored)


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
    known: dict[object, SingleFrame] = {}
    chains: dict[object, tuple[Chain, list[tuple[int, Index, Index, Index]]]] = {}
    for t in sorted(parts):
        own = tuple(one for one, _ in parts[t])
        key = tuple(map(id, own))
        frame = known[key] = known.get(key) or SingleFrame.of(own)
        at = frame.at(t, free, fixed)
        whole = key, at.entries
        if whole not in chains:
            chain = frame.chain(at)
            if chain.sparse or any(
                pattern_of(s, name) is not None for s in chain.sources for name in s.reads
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
