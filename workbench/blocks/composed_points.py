"""Points made of other points: those of a body in many frames, several as one, and some of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, vstack

from workbench.arrays import Array, Index
from workbench.blocks.block import Block
from workbench.blocks.points import NumericPoints, Points, PointsAt, PointSource, Tree
from workbench.errors import BadArgument, check_known


@dataclass(frozen=True, eq=False)
class FrameBlocks:
    """The blocks of T frames. A block of shape (K, 3) in each frame has the shape (T, K, 3) here.

    A block that is not `framed` is shared by all frames.
    """

    count: int  # T
    blocks: Mapping[str, Block]  # every block of the sequence, by name

    def __getitem__(self, name: str) -> Block:
        """A block of the sequence. Raises UnknownName."""
        check_known("block", name, self.blocks)
        return self.blocks[name]

    def columns(self, block: Block, some: Sequence[int]) -> cs.MX:
        """The symbols of a frame's block (K, 3) in some frames, side by side: (3, K len(some)).

        A shared block is repeated.
        """
        rows, width = block.symbol_shape
        of_sequence = self[block.name]
        if not of_sequence.framed:
            return cs.repmat(of_sequence.symbol, 1, len(some))
        wide = cs.reshape(of_sequence.symbol, rows, width * self.count)
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
        frame = cs.Function("frame", symbols, [expression])
        columns = [self.columns(block, some) for block in blocks]
        columns += [of_frames for _, of_frames in points]
        return (frame.map(len(some)) if len(some) > 1 else frame)(*columns)

    def points(self, points: Points, some: tuple[int, ...]) -> Points:
        """Points of a frame in some frames, (3, N len(some)), those of the first frame first."""
        numbers = points.symbol.shape[0]
        source = _FramedPoints(points.source, self, some, numbers)
        return Points.of(source, f"{points.name} in {len(some)} frames", numbers)


def framed(block: Block, count: int) -> Block:
    """The block of `count` frames, each of which has its own values of this block."""
    base = block.base
    return Block(block.name, (count, *base.shape), block.unit, base.labels, framed=True)


def joined(points: Sequence[Points], names: Sequence[str] | None = None) -> Points:
    """Points of several placeholders as one placeholder: those called `names`, in this order.

    None takes all. The points are those of one body in one pose, or of several. Raises BadArgument
    for no points, and for a name that is not one of a single point.
    """
    if not points:
        raise BadArgument("there are no points to join; give at least one")
    labels = [label for some in points for label in _labels(some)]
    for name in names or ():
        if labels.count(name) != 1:
            raise BadArgument(
                f"{labels.count(name)} points are called {name!r}; choose among {', '.join(labels)}"
            )
    places = range(len(labels)) if names is None else [labels.index(name) for name in names]
    sources = tuple(some.source for some in points)
    order = np.array(places, dtype=np.int64)
    return Points.of(_Joined(sources, order), " and ".join(some.name for some in points))


def _labels(points: Points) -> tuple[str, ...]:
    own = points.labels
    return tuple(f"{points.name} {i}" for i in range(points.count)) if own is None else own


@dataclass(frozen=True, eq=False)
class _Joined:
    """A source whose points are those of other sources, or some, in an order."""

    sources: tuple[PointSource, ...]
    order: Index

    @property
    def count(self) -> int:
        return len(self.order)

    @cached_property
    def expression(self) -> cs.MX | None:
        each = [source.expression for source in self.sources]
        return None if any(e is None for e in each) else cs.horzcat(*each)[:, self.order.tolist()]

    @property
    def blocks(self) -> tuple[Block, ...]:
        every = [block for source in self.sources for block in source.blocks]
        return tuple({block.name: block for block in every}.values())

    @property
    def tree(self) -> Tree | None:
        """The tree of the first source, which is that of all where these are one body's."""
        return self.sources[0].tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        each = [source.labels for source in self.sources]
        every = [label for labels in each for label in labels or ()]
        return None if None in each else tuple(every[i] for i in self.order)

    @cached_property
    def numeric(self) -> NumericPoints | None:
        each = [source.numeric for source in self.sources]
        parts = tuple(part for part in each if part is not None)
        return _JoinedNumbers(parts, self.order) if len(parts) == len(each) else None


@dataclass(frozen=True, eq=False)
class _JoinedNumbers(NumericPoints):
    parts: tuple[NumericPoints, ...]
    order: Index

    @property
    def reads(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for part in self.parts for name in part.reads))

    def evaluate(self, values: Mapping[str, Array]) -> "_JoinedAt":
        return _JoinedAt(self, [part.evaluate(values) for part in self.parts])

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        each = [part.evaluate_batch(values) for part in self.parts]
        return np.concatenate(each, axis=1)[:, self.order]


@dataclass(frozen=True, eq=False)
class _JoinedAt(PointsAt):
    of: _JoinedNumbers
    parts: list[PointsAt]

    @cached_property
    def points(self) -> Array:
        return np.concatenate([part.points for part in self.parts])[self.of.order]

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        edges, columns = self._places
        whole = {name: np.zeros((len(target), edges[-1])) for name, target in into.items()}
        for i, part in enumerate(self.parts):
            reads, own = self.of.parts[i].reads, slice(edges[i], edges[i + 1])
            part.write_jacobian({n: J[:, own] for n, J in whole.items() if n in reads}, None)
        for name, target in into.items():
            target[:] = whole[name][:, columns] * (1.0 if scale is None else scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        edges, columns = self._places
        cotangents = np.zeros(edges[-1])
        cotangents[columns] = cotangent
        gradients: dict[str, Array] = {}
        for part, own in zip(self.parts, np.split(cotangents, edges[1:-1]), strict=True):
            for name, gradient in part.vjp(own).items():
                gradients[name] = gradients.get(name, 0.0) + gradient
        return gradients

    @cached_property
    def _places(self) -> tuple[Index, Index]:
        """Where each part's numbers begin and end among those of all, and those that are chosen."""
        d = self.parts[0].points.shape[1]
        edges = np.cumsum([0, *(part.points.size for part in self.parts)])
        return edges, (d * self.of.order[:, None] + np.arange(d)).ravel()


@dataclass(frozen=True, eq=False)
class _FramedPoints:
    """The points of one source in some frames, those of the first frame first.

    `numbers` is d, how many numbers the source has of each point.
    """

    source: PointSource
    frames: FrameBlocks
    some: tuple[int, ...]
    numbers: int

    @property
    def count(self) -> int:
        return self.source.count * len(self.some)

    @cached_property
    def expression(self) -> cs.MX | None:
        """(d, N len(some)) m, in the blocks of the sequence."""
        of_frame = self.source.expression
        if of_frame is None:
            return None
        return self.frames.in_frames(of_frame, self.source.blocks, self.some)

    @property
    def blocks(self) -> tuple[Block, ...]:
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
        numeric = self.source.numeric
        if numeric is None:
            return None
        blocks = {name: self.frames[name] for name in numeric.reads}
        return _NumericFrames(numeric, blocks, self.some, self.source.count, self.numbers)

    def frozen(self, values: Mapping[str, Array]) -> PointSource:
        """The points with what the source chooses anew held in each frame."""
        frozen = getattr(self.source, "frozen", None)
        if frozen is None:
            return self
        own = {name for name, block in self.frames.blocks.items() if block.framed}
        each = []
        for t in self.some:
            source = frozen({n: value[t] if n in own else value for n, value in values.items()})
            each.append(_FramedPoints(source, self.frames, (t,), self.numbers))
        return _Joined(tuple(each), np.arange(self.count))


@dataclass(frozen=True, eq=False)
class _NumericFrames(NumericPoints):
    """The arithmetic of N points of a body, applied frame after frame."""

    source: NumericPoints
    blocks: Mapping[str, Block]
    some: Sequence[int]
    count: int
    numbers: int

    @property
    def reads(self) -> tuple[str, ...]:
        return self.source.reads

    def pattern(self, name: str) -> csc_array | None:
        """The points of each frame depend on their own part of a framed block."""
        block, own = self.blocks[name], self.source.pattern(name)
        if own is None:
            if not block.framed:
                return None
            own = csc_array(np.ones((self.numbers * self.count, block.size // block.shape[0])))
        return self.stacked([own] * len(self.some), block)

    def stacked(self, each: Sequence[csc_array], block: Block) -> csc_array:
        """The derivative by a block of the sequence, from those of all frames by their own part."""
        if not block.framed:
            return csc_array(vstack(each))
        rows, size = each[0].shape
        i = np.concatenate([J.indices + k * rows for k, J in enumerate(each)])
        columns = [np.repeat(np.arange(size), np.diff(J.indptr)) for J in each]
        j = np.concatenate([own + t * size for t, own in zip(self.some, columns, strict=True)])
        data = np.concatenate([J.data for J in each])
        whole = csc_array((data, (i, j)), shape=(rows * len(each), block.size))
        whole.sort_indices()
        return whole

    def evaluate(self, values: Mapping[str, Array]) -> "_FramesAt":
        each = [
            self.source.evaluate(
                {n: values[n][t] if b.framed else values[n] for n, b in self.blocks.items()}
            )
            for t in self.some
        ]
        return _FramesAt(self, each)

    def evaluate_batch(self, values: Mapping[str, Array]) -> Array:
        M, T = len(next(iter(values.values()))), len(self.some)

        def row(name: str) -> Array:
            value = values[name]
            if name in self.blocks and self.blocks[name].framed:
                value = value[:, list(self.some)]
                return value.reshape(M * T, *value.shape[2:])
            return np.repeat(value, T, axis=0)

        names = self.reads or tuple(values)[:1]  # points that read nothing take its M alone
        points = self.source.evaluate_batch({name: row(name) for name in names})
        return points.reshape(M, -1, self.numbers)


@dataclass(frozen=True, eq=False)
class _FramesAt(PointsAt):
    of: _NumericFrames
    frames: Sequence[PointsAt]

    @cached_property
    def points(self) -> Array:
        return np.concatenate([here.points for here in self.frames])

    def jacobian(self, name: str) -> csc_array:
        block = self.of.blocks[name]
        if self.of.source.pattern(name) is not None:
            return self.of.stacked([here.jacobian(name) for here in self.frames], block)
        each = [np.zeros((block.size // block.shape[0], h.points.size)) for h in self.frames]
        for here, into in zip(self.frames, each, strict=True):
            here.write_jacobian({name: into}, None)
        return self.of.stacked([csc_array(into.T) for into in each], block)

    def write_jacobian(self, into: Mapping[str, Array], scale: Array | None) -> None:
        width = self.frames[0].points.size
        for i, (t, here) in enumerate(zip(self.of.some, self.frames, strict=True)):
            own = slice(i * width, (i + 1) * width)
            parts = {}
            for name, array in into.items():
                block = self.of.blocks[name]
                if block.framed:
                    size = len(array) // block.shape[0]
                    array = array[t * size : (t + 1) * size]
                parts[name] = array[:, own]
            here.write_jacobian(parts, None if scale is None else scale[own])

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        gradients = {name: np.zeros(block.size) for name, block in self.of.blocks.items()}
        cotangents = cotangent.reshape(len(self.frames), -1)
        for t, here, own in zip(self.of.some, self.frames, cotangents, strict=True):
            for name, gradient in here.vjp(own).items():
                first = t * gradient.size if self.of.blocks[name].framed else 0
                gradients[name][first : first + gradient.size] += gradient
        return gradients
