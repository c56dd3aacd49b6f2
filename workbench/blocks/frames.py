"""The blocks of a sequence: those that every frame has for itself, and those that all share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as cs

from workbench.arrays import Array
from workbench.blocks.block import Block
from workbench.errors import check_known


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
