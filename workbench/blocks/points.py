"""Points on a body as residuals see them: a placeholder, and where it comes from."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks.block import Block

Array = NDArray[np.float64]
PLACEHOLDER = "placeholder("  # how the names of placeholders begin, for whoever prints a graph


@dataclass(frozen=True)
class Tree:
    """The kinematic tree behind a `pose` block, for whoever wants to name motions.

    `pose` is the block's name, `parents[k] < k` the parent of joint k, -1 for the root.
    """

    pose: str
    names: tuple[str, ...]
    parents: tuple[int, ...]

    def children(self, joint: int) -> tuple[int, ...]:
        """The joints whose parent is `joint`."""
        return tuple(k for k, parent in enumerate(self.parents) if parent == joint)


ManyPoints = Callable[[Mapping[str, Array]], Array]  # (M, *shape) by block -> (M, N, 3) m


class PointsAt(Protocol):
    """Points at one set of values; what is found on the way to one answer is kept for the next."""

    @property
    def points(self) -> Array:
        """The points, (N, 3), in metres."""

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write the points' derivative by each block of `into`, transposed: (size, 3 N).

        Each column is multiplied by `scale` (3 N,), where there is one.
        """

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """The gradient of sum(pull * points), pull (3 N,), by each block that is read, flat."""


class NumericPoints(Protocol):
    """Points by arithmetic on arrays, faster than any graph."""

    @property
    def reads(self) -> tuple[str, ...]:
        """The names of the blocks that the points depend on."""

    def at(self, values: Mapping[str, Array]) -> PointsAt:
        """The points where the blocks that are read have these values."""


class PointSource(Protocol):
    """Where points come from: an expression in the symbols of some blocks.

    The expression may be large and is asked for last: all else is known without it.
    """

    @property
    def count(self) -> int:
        """N, the number of points."""

    @property
    def expression(self) -> cs.MX:
        """The points, (3, N) in metres, in terms of the blocks' symbols."""

    @property
    def lean(self) -> cs.MX:
        """The same in as few operations as it takes to evaluate; the expression, as a rule."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks that the expression reads."""

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree that moves the points, where there is one."""

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""

    @property
    def many(self) -> ManyPoints | None:
        """The same points for many values at once, if the source has more than its graph."""

    @property
    def numeric(self) -> NumericPoints | None:
        """The same points by arithmetic, if the source knows its structure; None otherwise."""


@dataclass(frozen=True, eq=False)
class Points:
    """What a residual is written in: `symbol`, (3, N) in metres, standing for the source's points.

    A residual never knows a body. The problem puts the source's expression in place of
    the symbol when it wants the whole graph. An expression in the symbol does not depend on the
    blocks behind the source as far as CasADi knows: `in_blocks` writes it in terms of these.
    """

    symbol: cs.MX
    source: PointSource

    @staticmethod
    def of(source: PointSource, name: str) -> "Points":
        """A new placeholder for the points of a source, its symbol called `placeholder(name)`."""
        return Points(cs.MX.sym(f"{PLACEHOLDER}{name})", 3, source.count), source)

    @property
    def count(self) -> int:
        """The number of points, N."""
        return int(self.symbol.shape[1])

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""
        return self.source.labels


def in_full(source: PointSource) -> cs.MX:
    """What a source says of its points, to be derived."""
    return source.expression


def in_blocks(
    expression: cs.MX, points: Iterable[Points], said: Callable[[PointSource], cs.MX] = in_full
) -> cs.MX:
    """An expression with these placeholders replaced by what their sources say.

    The result depends on the symbols of blocks alone, and casadi.jacobian by them sees it. Take
    its Jacobian forwards, as `Problem.derivative` does: casadi.jacobian(expression, symbol,
    {"helper_options": {"ad_weight": 0}}); backwards CasADi 3.8 loses entries.
    """
    listed = tuple(points)
    if not listed:
        return expression
    return cs.graph_substitute(
        expression, [p.symbol for p in listed], [said(p.source) for p in listed]
    )


def unlisted(expression: cs.MX, points: Iterable[Points]) -> tuple[str, ...]:
    """The names of placeholders that an expression reads without their being among `points`."""
    listed = {p.symbol.__hash__() for p in points}
    return tuple(
        s.name()
        for s in cs.symvar(expression)
        if s.name().startswith(PLACEHOLDER) and s.__hash__() not in listed
    )
