"""Points made of other points: those of a body in many frames, several as one, and some of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, vstack

from workbench.arrays import Array, Index
from workbench.blocks.block import Block
from workbench.blocks.points import (
    NumericPoints,
    Points,
    PointsAt,
    PointSource,
)
from workbench.blocks.tree import Tree
from workbench.errors import BadArgument, check_known


@dataclass(frozen=True, eq=False)
class FrameBlocks:
    """The blocks of T frames. A block of shape (K, 3) in each frame has the shape (T, K, 3) here.

    A block that is not `framed` is shared by all frames.

    Attributes:
        count: T, the number of frames.
        blocks: every block of the sequence, by name.
    """

    count: int
    blocks: Mapping[str, Block]

    def __getitem__(self, name: str) -> Block:
        """A block of the sequence. Raises UnknownName."""
        check_known("block", name, self.blocks)
        return self.blocks[name]

    def values_in(self, t: int, values: Mapping[str, Array]) -> dict[str, Array]:
        """The values of the blocks in frame t, of those of the sequence."""
        return {
            name: value[t] if name in self.blocks and self.blocks[name].framed else value
            for name, value in values.items()
        }

    def columns(self, one: Block, some: Sequence[int]) -> cs.MX:
        """The symbols of a (K, 3) block in some frames, side by side: (3, K len(some)).

        A shared block is repeated.
        """
        rows, width = one.symbol_shape
        here = self[one.name]
        if not here.framed:
            return cs.repmat(here.symbol, 1, len(some))
        wide = cs.reshape(here.symbol, rows, width * self.count)
        if tuple(some) == tuple(range(self.count)):
            return wide
        return wide[:, [t * width + i for t in some for i in range(width)]]

    def in_frames(
        self,
        expression: cs.MX,
        blocks: Sequence[Block],
        some: Sequence[int],
        points: Sequence[tuple[cs.MX, cs.MX]] = (),
    ) -> cs.MX:
        """An expression in the blocks of one frame, evaluated for some frames, side by side.

        `points` are pairs: a placeholder of the frame, (3, N), and one of all these frames,
        (3, N len(some)). CasADi's map has one function for all frames, so that the graph is as
        small for a thousand of them as for one.
        """
        symbols = [*(block.symbol for block in blocks), *(own for own, _ in points)]
        if not symbols:  # CasADi answers a call without arguments by a dictionary
            return cs.repmat(expression, 1, len(some))
        one = cs.Function("frame", symbols, [expression])
        given = [*(self.columns(block, some) for block in blocks), *(all_ for _, all_ in points)]
        return (one.map(len(some)) if len(some) > 1 else one)(*given)


def framed(one: Block, count: int) -> Block:
    """The block of `count` frames, each of which has its own values of this block."""
    return Block(one.name, (count, *one.base.shape), one.unit, one.base.labels, framed=True)


def joined(points: Sequence[Points], order: Sequence[str] | None = None) -> Points:
    """All points of several placeholders as one placeholder, in the order of the given names.

    None keeps the order. With it, every point needs a name of its own, and each name stands for
    one point. The points are those of one body in one pose, or of several. Raises BadArgument for
    no points, and for an order that does not name each point once.
    """
    if not points:
        raise BadArgument("there are no points to join; give at least one")
    labels = [label for some in points for label in _labels(some)]
    places = np.arange(len(labels))
    if order is not None:
        if sorted(order) != sorted(labels) or len(set(labels)) != len(labels):
            raise BadArgument(
                f"the order names {len(order)} points, but those to be joined are "
                f"{', '.join(labels)}; name each of them once"
            )
        places = np.array([labels.index(name) for name in order])
    sources = tuple(some.source for some in points)
    return Points.of(Joined(sources, places), " and ".join(some.name for some in points))


def chosen(points: Points, names: Sequence[str]) -> Points:
    """Some points of a placeholder as another one, by their names and in this order.

    Raises BadArgument for a name that is not one of a single point.
    """
    labels = _labels(points)
    for name in names:
        if labels.count(name) != 1:
            raise BadArgument(
                f"{labels.count(name)} points of {points.name!r} are called {name!r}; choose among "
                f"{', '.join(labels)}"
            )
    places = np.array([labels.index(name) for name in names], dtype=np.int64)
    return Points.of(Joined((points.source,), places), points.name)


def _labels(points: Points) -> tuple[str, ...]:
    own = points.labels
    return tuple(f"{points.name} {i}" for i in range(points.count)) if own is None else own


@dataclass(frozen=True, eq=False)
class Joined:
    """A source whose points are those of other sources, or some, in an order; see PointSource."""

    sources: tuple[PointSource, ...]
    order: Index

    @property
    def count(self) -> int:
        """The number of points."""
        return len(self.order)

    @cached_property
    def expression(self) -> cs.MX | None:
        """The points in symbols, (d, N) m; None if a source has no graph."""
        each = [source.expression for source in self.sources]
        return None if any(e is None for e in each) else cs.horzcat(*each)[:, self.order.tolist()]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of all sources, each once."""
        every = [block for source in self.sources for block in source.blocks]
        return tuple({block.name: block for block in every}.values())

    @property
    def tree(self) -> Tree | None:
        """The tree of the first source, which is that of all where these are one body's."""
        return self.sources[0].tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        """The names of the points; None if those of a source have none."""
        every: list[str] = []
        for source in self.sources:
            if source.labels is None:
                return None
            every += source.labels
        return tuple(every[i] for i in self.order)

    @cached_property
    def numeric(self) -> NumericPoints | None:
        """The points by arithmetic; None if a source has none."""
        each = [source.numeric for source in self.sources]
        found = tuple(one for one in each if one is not None)
        return JoinedNumbers(found, self.order) if len(found) == len(each) else None


@dataclass(frozen=True, eq=False)
class JoinedNumbers(NumericPoints):
    """The arithmetic of several sources, one after another; see NumericPoints."""

    parts: tuple[NumericPoints, ...]
    order: Index

    @property
    def reads(self) -> tuple[str, ...]:
        """The blocks that any of them reads."""
        return tuple(dict.fromkeys(name for part in self.parts for name in part.reads))

    def evaluate(self, values: Mapping[str, Array]) -> "JoinedAt":
        """The points at these values."""
        return JoinedAt(
            tuple(part.evaluate(values) for part in self.parts),
            tuple(part.reads for part in self.parts),
            self.order,
        )

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points at M sets of values, (M, N, d) m."""
        each = [part.evaluate_batch(values) for part in self.parts]
        return np.concatenate(each, axis=1)[:, self.order]


@dataclass(frozen=True, eq=False)
class JoinedAt(PointsAt):
    """Joined points at one set of values; see PointsAt."""

    parts: tuple[PointsAt, ...]
    reads: tuple[tuple[str, ...], ...]
    order: Index

    @cached_property
    def points(self) -> Array:
        """The points, (N, d) m."""
        return np.concatenate([part.points for part in self.parts])[self.order]

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the derivative by each block of `into`, (size, d N)."""
        columns = self._columns
        width = sum(part.points.size for part in self.parts)
        whole = {name: np.zeros((len(target), width)) for name, target in into.items()}
        first = 0
        for part, reads in zip(self.parts, self.reads, strict=True):
            last = first + part.points.size
            own = {n: np.zeros((len(t), last - first)) for n, t in whole.items() if n in reads}
            part.write_jacobian(own, None)
            for name, some in own.items():
                whole[name][:, first:last] = some
            first = last
        for name, target in into.items():
            target[:] = whole[name][:, columns] * (1.0 if scale is None else scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradient of sum(cotangent * points) by each block; flat."""
        back = np.zeros(sum(part.points.size for part in self.parts))
        back[self._columns] = cotangent
        found: dict[str, Array] = {}
        first = 0
        for part in self.parts:
            last = first + part.points.size
            for name, some in part.vjp(back[first:last]).items():
                found[name] = found[name] + some if name in found else some
            first = last
        return found

    @property
    def _columns(self) -> Index:
        d = self.parts[0].points.shape[1]
        return np.asarray((d * self.order[:, None] + np.arange(d)).ravel())


@dataclass(frozen=True, eq=False)
class FramedPoints:
    """The points of one source in some frames, those of the first frame first; see PointSource.

    Attributes:
        source: where the points of a single frame come from.
        frames: the blocks of the sequence.
        some: the numbers of the frames whose points these are.
        numbers: d, how many numbers the source has of each point: its three coordinates, or
            others, such as its distance from a surface.
    """

    source: PointSource
    frames: FrameBlocks
    some: tuple[int, ...]
    numbers: int = 3

    @property
    def count(self) -> int:
        """The number of points in all of these frames together."""
        return self.source.count * len(self.some)

    @cached_property
    def expression(self) -> cs.MX | None:
        """(d, N len(some)) m, in the blocks of the sequence."""
        found = self.source.expression
        return (
            None if found is None else self.frames.in_frames(found, self.source.blocks, self.some)
        )

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of the sequence that the points depend on."""
        return tuple(self.frames[block.name] for block in self.source.blocks)

    @cached_property
    def tree(self) -> Tree | None:
        """The source's tree once for each frame: a forest, whose roots have the parent -1."""
        tree = self.source.tree
        if tree is None or not any(self.frames[name].framed for name in tree.blocks):
            return tree
        K = len(tree.names)

        def place_in(t: int, place: tuple[str, int]) -> tuple[str, int]:
            block = self.frames[place[0]]
            first = t * (block.size // self.frames.count) if block.framed else 0
            return place[0], first + place[1]

        return Tree(
            tree.pose,
            tuple(f"{t}, {name}" for t in self.some for name in tree.names),
            tuple(p + i * K if p >= 0 else p for i in range(len(self.some)) for p in tree.parents),
            tuple(place and place_in(t, place) for t in self.some for place in tree.places),
        )

    @property
    def labels(self) -> tuple[str, ...] | None:
        """`12, left_wrist`: the frame, and the point's name."""
        names = self.source.labels
        if names is None:
            return None
        return tuple(f"{t}, {name}" for t in self.some for name in names)

    @cached_property
    def numeric(self) -> NumericPoints | None:
        """The arithmetic of the source, applied frame after frame; None if it has none."""
        found = self.source.numeric
        if found is None:
            return None
        blocks = {name: self.frames[name] for name in found.reads}
        return NumericFrames(found, blocks, self.some, self.source.count, self.numbers)

    def frozen(self, values: Mapping[str, Array]) -> PointSource:
        """The points with what the source chooses anew held in each frame; see ChosenAnew."""
        frozen = getattr(self.source, "frozen", None)
        if frozen is None:
            return self
        held = (frozen(self.frames.values_in(t, values)) for t in self.some)
        frames = zip(self.some, held, strict=True)
        each = [FramedPoints(one, self.frames, (t,), self.numbers) for t, one in frames]
        return Joined(tuple(each), np.arange(self.count))


@dataclass(frozen=True, eq=False)
class NumericFrames(NumericPoints):
    """The arithmetic of the points of a body in many frames; see NumericPoints.

    Attributes:
        source: the arithmetic for the points of a single frame.
        blocks: the blocks of the sequence that the points depend on, by name.
        some: the numbers of the frames whose points these are.
        count: N, the number of points in one frame.
        numbers: d, how many numbers there are of each point.
    """

    source: NumericPoints
    blocks: Mapping[str, Block]
    some: Sequence[int]
    count: int
    numbers: int = 3

    @cached_property
    def framed(self) -> dict[str, bool]:
        """Which blocks each frame has for itself."""
        return {name: block.framed for name, block in self.blocks.items()}

    def pattern(self, name: str) -> csc_array | None:
        """Where the derivative by a block can be nonzero, None if it is dense.

        The points of each frame depend on their own part of a framed block.
        """
        block, own = self.blocks[name], self.source.pattern(name)
        if not block.framed:
            return None if own is None else csc_array(vstack([own] * len(self.some)))
        T = block.shape[0]
        if own is None:
            own = csc_array(np.ones((self.numbers * self.count, block.size // T)))
        return on_the_diagonal([own] * len(self.some), self.some, T)

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the points depend on."""
        return self.source.reads

    def evaluate(self, values: Mapping[str, Array]) -> "FramesAt":
        """The points where the blocks of the sequence have these values."""
        each = [
            self.source.evaluate(
                {n: values[n][t] if own else values[n] for n, own in self.framed.items()}
            )
            for t in self.some
        ]
        return FramesAt(self, each)

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        """The points (M, N len(some), d) m in all these frames, for M sets of values."""
        M, T = len(next(iter(values.values()))), len(self.some)

        def row(name: str) -> Array:
            value = values[name]
            if self.framed.get(name, False):
                value = value[:, list(self.some)]
                return value.reshape(M * T, *value.shape[2:])
            return np.repeat(value, T, axis=0)

        names = self.reads or tuple(values)[:1]  # points that read nothing take its M alone
        found = self.source.evaluate_batch({name: row(name) for name in names})
        return found.reshape(M, -1, self.numbers)


@dataclass(frozen=True, eq=False)
class FramesAt(PointsAt):
    """The points of all frames at one set of values; see PointsAt.

    Attributes:
        of: the arithmetic of all frames.
        frames: the points of each frame.
    """

    of: NumericFrames
    frames: Sequence[PointsAt]

    @cached_property
    def points(self) -> Array:
        """The points, (N len(some), d) m."""
        return np.concatenate([here.points for here in self.frames])

    def jacobian(self, name: str) -> csc_array:
        """The derivative by a block that has a pattern, (d N len(some), size)."""
        block, sparse = self.of.blocks[name], self.of.source.pattern(name) is not None
        each = [here.jacobian(name) if sparse else self._dense(here, name) for here in self.frames]
        if not block.framed:
            return csc_array(vstack(each))
        return on_the_diagonal(each, self.of.some, block.shape[0])

    def _dense(self, here: PointsAt, name: str) -> csc_array:
        """The derivative of one frame's points by its own part of a block, (d N, size)."""
        block = self.of.blocks[name]
        into = np.zeros((block.size // block.shape[0], here.points.size))
        here.write_jacobian({name: into}, None)
        return csc_array(into.T)

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """The derivative, transposed and with all its zeros, into[block] (size, d N len(some))."""
        width = self.frames[0].points.size
        for i, (t, here) in enumerate(zip(self.of.some, self.frames, strict=True)):
            at = slice(i * width, (i + 1) * width)
            parts = {}
            for name, array in into.items():
                if self.of.framed[name]:
                    size = len(array) // self.of.blocks[name].shape[0]
                    array = array[t * size : (t + 1) * size]
                parts[name] = array[:, at]
            here.write_jacobian(parts, None if scale is None else scale[at])

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradient by every block that is read, flat."""
        found = {name: np.zeros(block.size) for name, block in self.of.blocks.items()}
        cotangents = cotangent.reshape(len(self.frames), -1)
        for t, here, own in zip(self.of.some, self.frames, cotangents, strict=True):
            for name, part in here.vjp(own).items():
                if self.of.framed[name]:
                    found[name][t * part.size : (t + 1) * part.size] += part
                else:
                    found[name] += part
        return found


def on_the_diagonal(each: Sequence[csc_array], some: Sequence[int], count: int) -> csc_array:
    """A matrix whose rows are those of some frames, and whose columns are those of all frames.

    The frames may come in any order, and more than once.
    """
    rows, size = each[0].shape
    i = np.concatenate([one.indices + k * rows for k, one in enumerate(each)])
    columns = [np.repeat(np.arange(size), np.diff(one.indptr)) for one in each]
    j = np.concatenate([own + t * size for t, own in zip(some, columns, strict=True)])
    data = np.concatenate([one.data for one in each])
    found = csc_array((data, (i, j)), shape=(rows * len(each), size * count))
    found.sort_indices()
    return found
