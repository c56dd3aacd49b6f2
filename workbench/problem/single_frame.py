"""A single frame of a sequence: which blocks it reads, and where its numbers stand."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Index
from workbench.blocks import Block, Layout, Points
from workbench.problem.chain import Chain
from workbench.problem.graph import split
from workbench.problem.naming import blocks_behind, distinct
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class FramePlaces:
    """The places of a frame's numbers among the free and fixed ones of the sequence.

    Attributes:
        free: the layout of the frame's free numbers.
        fixed: the layout of the frame's fixed numbers.
        columns: (n,) where its free numbers stand among those of the sequence.
        given: (h,) where its fixed numbers stand among those of the sequence.
    """

    free: Layout
    fixed: Layout
    columns: Index
    given: Index

    @property
    def entries(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Which entries of which blocks are free."""
        return tuple((block.name, tuple(block.places)) for block in self.free.blocks)


@dataclass(frozen=True, eq=False)
class SingleFrame:
    """The residuals of one frame, stacked, and the blocks that they read.

    Attributes:
        stacked: (m, 1) the whitened residuals.
        points: the placeholders that they read.
        blocks: the blocks that they read, by name.
    """

    stacked: cs.MX
    points: tuple[Points, ...]
    blocks: dict[str, Block]

    @staticmethod
    def of(residuals: Sequence[Residual]) -> "SingleFrame":
        """The residuals of a frame."""
        stacked = cs.vertcat(*[residual.whitened for residual in residuals])
        points = distinct(p for r in residuals for p in r.points)
        described = [b for r in residuals for b in r.blocks]
        described += [b for p in points for b in p.source.blocks]
        return SingleFrame(stacked, points, blocks_behind(stacked, points, described))

    def at(self, t: int, free: Layout, fixed: Layout) -> FramePlaces:
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
        return FramePlaces(
            Layout(tuple(own)), Layout(tuple(left)), np.concatenate(columns), np.concatenate(given)
        )

    def chain(self, at: FramePlaces) -> Chain:
        """The chain rule of the frame."""
        return Chain(*split(self.stacked, self.points, at.free, at.fixed), at.free, at.fixed)


def _first(block: Block, t: int) -> int:
    """The place where the entries of a frame begin in a block of the sequence."""
    return t * (block.size // block.shape[0]) if block.framed else 0
