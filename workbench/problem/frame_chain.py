"""The numbers of a sequence: its frames by the chain rule of one frame, the rest by that of all."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from workbench.blocks import Layout, PointsAt
from workbench.blocks.layout import all_values
from workbench.blocks.sparse_points import pattern_of
from workbench.problem.alike import Alike
from workbench.problem.alone import Alone, InSequence
from workbench.problem.band_order import BandOrder
from workbench.problem.block_matrix import BlockMatrix, Entries, Rows, joined
from workbench.problem.chain import Chain
from workbench.problem.naming import rows_of
from workbench.problem.rounding import Support, half_squared
from workbench.problem.storage import Matrix, entries_at, is_sparse
from workbench.residuals import Residual

Array = NDArray[np.float64]
Index = NDArray[np.int64]
WORTH = 8  # numbers of a band for each entry of the Jacobian: of more, most are zero


class Numbers(Protocol):
    """How a problem computes; see Chain and FrameChain."""

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,)."""

    def linearize(self, x: Array, fixed: Array) -> tuple[Array, Matrix]:
        """r (m,) and J (m, n)."""

    def gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,)."""

    def made_of(self, x: Array, fixed: Array) -> Array:
        """The size of what each row is made of (m,)."""

    @property
    def sparse(self) -> bool:
        """Whether the Jacobian is no array."""

    @property
    def pattern(self) -> csc_array:
        """Where it may be nonzero."""

    @property
    def support(self) -> "Support":
        """Which rows each free number can change."""


class FrameChain:
    """Residual, Jacobian and gradient of a problem some of whose residuals are of frames.

    Frames that have the same residuals, and of which the same entries are free, share one chain
    rule (`Alike`). What is no residual of frames, such as what is between them, goes by a chain
    rule of the whole problem.
    """

    def __init__(self, residuals: Sequence[Residual], free: Layout, fixed: Layout) -> None:
        self._free, self._fixed = free, fixed
        self._groups, others = _grouped(residuals, free, fixed)
        self._size, rows = sum(r.size for r in residuals), rows_of(residuals)
        none = np.zeros(0, dtype=np.int64)
        at = (np.arange(rows[r.name].start, rows[r.name].stop) for r in others)
        self._rest_rows = np.concatenate([none, *at])
        self._rest = Chain.of(others, free, fixed) if others else None
        self._last: tuple[bytes, list[list[list[PointsAt]]]] = (b"", [])

    def residual(self, x: Array, fixed: Array) -> Array:
        """r (m,)."""
        return self._gathered(
            x, fixed, lambda group, places: group.residual(x, fixed, places),
            lambda rest: rest.residual(x, fixed),
        )  # fmt: skip

    def made_of(self, x: Array, fixed: Array) -> Array:
        """The size of what each row is made of (m,); see Chain."""
        return self._gathered(
            x, fixed, lambda group, places: group.made_of(x, fixed, places),
            lambda rest: rest.made_of(x, fixed),
        )  # fmt: skip

    def gradient(self, x: Array, fixed: Array) -> tuple[float, Array]:
        """The cost and its gradient (n,); no Jacobian is formed."""
        cost, g = (0.0, np.zeros(len(x))) if self._rest is None else self._rest.gradient(x, fixed)
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
            r[self._rest_rows], J = self._rest.linearize(x, fixed)
            parts.append(_entries(J, self._rest_pattern))
        rest = self._entries.matrix(parts)
        found = BlockMatrix(rest, tuple(blocks), self._block_places, self._order)
        if not self.sparse:
            return r, found.dense
        return r, found if self._banded else found.sparse

    @cached_property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by the blocks of its frames, or by its nonzeros."""
        whole = sum(g.whole_rows.size * g.columns.shape[1] for g in self._groups)
        return is_sparse(self._size, self._free.size, whole + len(self._entries.rows))

    @cached_property
    def pattern(self) -> csc_array:
        """Where the Jacobian may be nonzero, as far as residuals tell: points by whole blocks."""
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
        """Which rows each free number can change: frame by frame, and what the rest reads."""
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
        of_group: Callable[[Alike, list[list[PointsAt]]], Array],
        of_rest: Callable[[Chain], Array],
    ) -> Array:
        found = np.empty(self._size)
        for group, places in zip(self._groups, self._places(x, fixed), strict=True):
            found[group.rows] = of_group(group, places)
        if self._rest is not None:
            found[self._rest_rows] = of_rest(self._rest)
        return found

    def _places(self, x: Array, fixed: Array) -> list[list[list[PointsAt]]]:
        """The points of every group, source and frame at x; kept for the next call there."""
        last, key = self._last, x.tobytes() + fixed.tobytes()
        if key != last[0]:
            values = all_values(self._free, x, self._fixed, fixed)
            blocks = {b.base.name: b.base for b in (*self._free.blocks, *self._fixed.blocks)}
            own = {name: block.framed for name, block in blocks.items()}
            T = 1 + max((int(group.frames.max()) for group in self._groups), default=-1)
            each = [{n: v[t] if own[n] else v for n, v in values.items()} for t in range(T)]
            self._last = last = key, [group.places(each) for group in self._groups]
        return last[1]

    # How the Jacobian is put together.

    @cached_property
    def _rest_pattern(self) -> csc_array:
        assert self._rest is not None
        return self._rest.pattern

    @cached_property
    def _entries(self) -> Entries:
        """Where the entries stand that are in no block."""
        parts = [group.single for group in self._groups]
        if self._rest is not None:
            one = self._rest_pattern
            columns = np.repeat(np.arange(one.shape[1]), np.diff(one.indptr))
            parts.append((self._rest_rows[one.indices], columns))
        return joined(parts, (self._size, self._free.size))

    @cached_property
    def _block_places(self) -> tuple[Rows, ...]:
        return tuple(Rows(group.whole_rows, group.columns) for group in self._groups)

    @cached_property
    def _order(self) -> BandOrder:
        rest = self._entries.matrix([np.ones(len(self._entries.rows))])
        return _order(self._free, rest)

    @cached_property
    def _banded(self) -> bool:
        """Whether normal equations of a band are worth it: of long bands, most is zero."""
        stored = len(self._entries.rows)
        stored += sum(g.whole_rows.size * g.columns.shape[1] for g in self._groups)
        return bool((self._order.reach + 1) * len(self._order.inner) <= WORTH * stored)


def _entries(J: Matrix, pattern: csc_array) -> Array:
    """The entries of a Jacobian in the places of its pattern, column by column."""
    if isinstance(J, np.ndarray):
        columns = np.repeat(np.arange(pattern.shape[1]), np.diff(pattern.indptr))
        return np.asarray(J[pattern.indices, columns])
    assert isinstance(J, csc_array)
    return entries_at(J, pattern)


def _order(free: Layout, rest: csc_array) -> BandOrder:
    """Frame after frame, and last what all share; `rest` says how frames meet each other."""
    frame_of = np.full(free.size, -1)
    for block in free.blocks:
        if block.base.framed:
            size = block.base.size // block.base.shape[0]
            frame_of[free.slices[block.name]] = np.array(block.places, dtype=np.int64) // size
    inner = np.flatnonzero(frame_of >= 0)
    inner = inner[np.argsort(frame_of[inner], kind="stable")]
    count = int(frame_of.max(initial=-1)) + 1
    edges = np.searchsorted(frame_of[inner], np.arange(count + 1))
    position = np.full(free.size, -1)
    position[inner] = np.arange(len(inner))
    reach = int(np.diff(edges).max(initial=1)) - 1
    by_rows = csr_array(rest)
    at = position[by_rows.indices]
    rows = np.repeat(np.arange(by_rows.shape[0]), np.diff(by_rows.indptr))[at >= 0]
    at = at[at >= 0]
    if len(at):
        starts = np.flatnonzero(np.diff(rows, prepend=-1))
        spans = np.maximum.reduceat(at, starts) - np.minimum.reduceat(at, starts)
        reach = max(reach, int(spans.max()))
    return BandOrder(inner, np.flatnonzero(frame_of < 0), reach, edges)


def _grouped(
    residuals: Sequence[Residual], free: Layout, fixed: Layout
) -> tuple[list[Alike], list[Residual]]:
    """Frames that are alike, and the residuals that are of no such frames.

    All are of none where a frame alone has a sparse Jacobian: its blocks would be full of zeros.
    """
    rows = rows_of(residuals)
    parts: dict[int, list[tuple[Residual, Index]]] = {}  # of each frame, with their rows
    for residual in residuals:
        first = rows[residual.name].start
        for t, one in residual.each:
            parts.setdefault(t, []).append((one, np.arange(first, first + one.size)))
            first += one.size
    known: dict[object, Alone] = {}
    chains: dict[object, tuple[Chain, list[tuple[int, Index, InSequence]]]] = {}
    for t in sorted(parts):
        own = tuple(one for one, _ in parts[t])
        key = tuple(map(id, own))
        frame = known.setdefault(key, Alone.of(own)) if key not in known else known[key]
        at = frame.at(t, free, fixed)
        whole = key, at.entries
        if whole not in chains:
            chain = frame.chain(at)
            if chain.sparse or any(
                pattern_of(s, name) is not None for s in chain.sources for name in s.reads
            ):
                return [], list(residuals)
            chains[whole] = chain, []
        chains[whole][1].append((t, np.concatenate([r for _, r in parts[t]]), at))
    groups = [
        Alike(
            chain,
            np.array([t for t, _, _ in members]),
            np.array([r for _, r, _ in members]),
            np.array([at.columns for _, _, at in members]),
            np.array([at.given for _, _, at in members]),
        )
        for chain, members in chains.values()
    ]
    return groups, [r for r in residuals if not r.each]
