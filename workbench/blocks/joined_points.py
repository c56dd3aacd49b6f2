"""Points of several sources as one: joints and vertices of a body in one residual."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks.block import Block
from workbench.blocks.points import NumericPoints, Points, PointsAt, PointSource
from workbench.blocks.tree import Tree
from workbench.errors import BadArgument


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
class JoinedNumbers:
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
class JoinedAt:
    """Joined points at one set of values; see PointsAt."""

    parts: tuple[PointsAt, ...]
    reads: tuple[tuple[str, ...], ...]
    order: Index

    @cached_property
    def points(self) -> Array:
        """The points, (N, d) m."""
        return np.concatenate([part.points for part in self.parts])[self.order]

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the derivative by each block of `into`, (size, d N)."""
        columns = self._columns
        width = sum(part.points.size for part in self.parts)
        whole = {name: np.zeros((len(target), width)) for name, target in into.items()}
        first = 0
        for part, reads in zip(self.parts, self.reads, strict=True):
            last = first + part.points.size
            own = {n: np.zeros((len(t), last - first)) for n, t in whole.items() if n in reads}
            part.tangent(own, None)
            for name, some in own.items():
                whole[name][:, first:last] = some
            first = last
        for name, target in into.items():
            target[:] = whole[name][:, columns] * (1.0 if scale is None else scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """The gradient of sum(pull * points) by each block; flat."""
        back = np.zeros(sum(part.points.size for part in self.parts))
        back[self._columns] = pull
        found: dict[str, Array] = {}
        first = 0
        for part in self.parts:
            last = first + part.points.size
            for name, some in part.adjoint(back[first:last]).items():
                found[name] = found[name] + some if name in found else some
            first = last
        return found

    @property
    def _columns(self) -> Index:
        d = self.parts[0].points.shape[1]
        return np.asarray((d * self.order[:, None] + np.arange(d)).ravel())
