"""One frame of a sequence: its unknowns as a layout of its own, and its problem alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Index
from workbench.blocks import Block, Layout, Tree, Values
from workbench.errors import BadArgument
from workbench.problem import Problem
from workbench.residuals import Residual


@dataclass(frozen=True, eq=False)
class SingleFrames:
    """The frames of a sequence, one by one.

    Attributes:
        problem: the sequence.
        values: the values of all blocks that it reads.
    """

    problem: Problem
    values: Values

    @cached_property
    def count(self) -> int:
        """T, the number of frames."""
        return max((b.shape[0] for b in self.problem.known.values() if b.framed), default=0)

    @cached_property
    def layout(self) -> Layout:
        """The blocks of one frame of which anything is free in any frame."""
        blocks = (block.base for block in self.problem.free.blocks)
        return Layout(tuple(of_one_frame(block) for block in blocks if block.framed))

    @cached_property
    def shared(self) -> Layout:
        """The unknowns that all frames share."""
        return Layout(tuple(b for b in self.problem.free.blocks if not b.base.framed))

    @cached_property
    def places(self) -> tuple[Index, Index]:
        """The frame of each unknown (n,), -1 if it is shared, and its place in that layout."""
        free = self.problem.free
        frame, place = np.full(free.size, -1), np.zeros(free.size, dtype=np.int64)
        for block in free.blocks:
            at, entries = free.slices[block.name], np.array(block.places, dtype=np.int64)
            if block.base.framed:
                size = block.base.size // block.base.shape[0]
                frame[at] = entries // size
                place[at] = self.layout.slices[block.name].start + entries % size
            else:
                start = self.shared.slices[block.name].start
                place[at] = np.arange(start, start + block.size)
        return frame, place

    @cached_property
    def trees(self) -> tuple[Tree, ...]:
        """The kinematic trees of the bodies whose points single frames read."""
        parts = {id(one): one for r in self.problem.residuals for _, one in r.by_frame}
        trees = (p.source.tree for one in parts.values() for p in one.points)
        return tuple({tree.places: tree for tree in trees if tree is not None}.values())

    def alone(self, t: int) -> tuple[Problem, Values]:
        """Frame t as a problem, with the shared unknowns free too, and its values.

        What is between frames is left out; what reads shared blocks alone is part of it. Raises
        BadArgument for a frame that is not there, or that has no residual of its own.
        """
        if not 0 <= t < self.count:
            raise BadArgument(f"there is no frame {t}: the {self.count} frames count from 0")
        own = [one for r in self.problem.residuals for s, one in r.by_frame if s == t]
        if not own:
            raise BadArgument(f"frame {t} has no residuals of its own, and so no diagnosis")
        terms = [
            *own,
            *(r for r in self.problem.residuals if not r.by_frame and self._of_shared(r)),
        ]
        whole = Problem(terms, ())
        names = self._free_in(t, whole.known)
        known = self.problem.known
        values = {
            name: self.values[name][t] if known[name].framed else self.values[name]
            for name in whole.known
        }
        return whole.freeing(*names), values

    def _of_shared(self, residual: Residual) -> bool:
        return not any(self.problem.known[name].framed for name in residual.reads)

    def _free_in(self, t: int, read: dict[str, Block]) -> Sequence[str]:
        frame, place = self.places
        own = self.layout.chosen(place[frame == t]).spelled()
        return [name for name in (*own, *self.shared.spelled()) if name.partition("[")[0] in read]


def of_one_frame(block: Block) -> Block:
    """The block that one frame has of a block of all frames."""
    return Block(block.name, block.shape[1:], block.unit, block.labels)
