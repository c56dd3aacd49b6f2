"""Points on a body as residuals see them: a placeholder, and where it comes from."""

from dataclasses import dataclass
from typing import Protocol

import casadi as cs

from workbench.blocks.block import Block


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


class PointSource(Protocol):
    """Where points come from: an expression in the symbols of some blocks."""

    @property
    def expression(self) -> cs.MX:
        """The points, (3, N) in metres, in terms of the blocks' symbols."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks that the expression reads."""

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree that moves the points, where there is one."""

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""


@dataclass(frozen=True, eq=False)
class Points:
    """What a residual is written in: `symbol`, (3, N) in metres, standing for the source's points.

    A residual never knows a body. The problem puts the source's expression in place of
    the symbol when it wants the whole graph.
    """

    symbol: cs.MX
    source: PointSource

    @staticmethod
    def of(source: PointSource, name: str) -> "Points":
        """A new placeholder for the points of a source."""
        return Points(cs.MX.sym(name, *source.expression.shape), source)

    @property
    def count(self) -> int:
        """N."""
        return int(self.symbol.shape[1])

    @property
    def labels(self) -> tuple[str, ...] | None:
        """A name for each point, where they have names."""
        return self.source.labels
