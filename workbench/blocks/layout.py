"""The order in which blocks fill a flat vector."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks.block import Block
from workbench.blocks.checks import mapping, reals, several
from workbench.errors import BadBlock, MissingValue, NonFiniteValue, ShapeMismatch, UnknownName

# Of each block, by its name: its numbers, in its unit and of its shape.
Values = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Layout:
    """Blocks one after another in one vector, each row by row: (N, 3) is x0 y0 z0 x1 y1 z1 ...

    Values are always those of whole blocks.

    Attributes:
        blocks: the blocks in order. Where only some entries of a block stand in the vector, this
            is the part (`Block.part`).
    """

    blocks: tuple[Block, ...]

    def __post_init__(self) -> None:
        self.__dict__["blocks"] = several("the blocks of a layout", self.blocks, Block, BadBlock)

    @property
    def names(self) -> tuple[str, ...]:
        """The blocks' names, in order."""
        return tuple(block.name for block in self.blocks)

    @cached_property
    def size(self) -> int:
        """The length of the flat vector."""
        return int(self._edges[-1])

    @cached_property
    def _edges(self) -> Index:
        return np.cumsum([0, *(block.size for block in self.blocks)])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """The places of each block in the flat vector."""
        return {
            b.name: slice(int(i), int(j))
            for b, (i, j) in zip(self.blocks, pairwise(self._edges), strict=True)
        }

    @cached_property
    def single_labels(self) -> dict[str, int]:
        """The place of each label that names exactly one entry, such as `pose[12, head, x]`."""
        found: dict[str, int] = {}
        several: set[str] = set()
        for i in range(self.size):
            label = self.label(i)
            several |= {label} if label in found else set()
            found[label] = i
            while ", " in label:
                label = label.rpartition(", ")[0]
                several.add(label + "]")
        return {label: i for label, i in found.items() if label not in several}

    def __getitem__(self, name: str) -> Block:
        for block in self.blocks:
            if block.name == name:
                return block
        raise UnknownName("block", name, self.names)

    def pack(self, values: Mapping[str, ArrayLike]) -> Array:
        """The named arrays as one vector (size,), after a check of every name, shape and number.

        Raises MissingValue, NotNumbers, ShapeMismatch, NonFiniteValue, or BadArgument if `values`
        is no dict.
        """
        mapping("values of blocks", values)
        flat = np.empty(self.size)
        for block in self.blocks:
            if block.name not in values:
                raise MissingValue(block.name, block.shape, values)
            value = reals(f"block {block.name!r}", values[block.name])
            part, block = block, block.base
            # a bare symbol cannot tell (3,) from (1, 3) or () from (1,): the same numbers
            if [n for n in value.shape if n != 1] != [n for n in block.shape if n != 1]:
                raise ShapeMismatch(block.name, expected=block.shape, got=value.shape)
            if not np.isfinite(value).all():
                bad = ~np.isfinite(value.ravel())
                raise NonFiniteValue(block.name, block.where(bad), float(value.ravel()[bad][0]))
            taken = value if part.entries is None else part.taken(value)
            flat[self.slices[block.name]] = taken.ravel()
        return flat

    def unpack(self, flat: Array, around: Mapping[str, ArrayLike] | None = None) -> Values:
        """The named arrays from a flat vector, the inverse of `pack`; they share one copy of it.

        If the layout has only part of a block, its other entries come from `around`, which holds
        the whole block. Raises MissingValue if it has none.
        """
        own, found = np.array(flat, dtype=float), {}
        for block in self.blocks:
            numbers = own[self.slices[block.name]]
            if block.whole is None:
                found[block.name] = numbers.reshape(block.shape)
                continue
            if around is None or block.name not in around:
                raise MissingValue(block.name, block.whole.shape, around or ())
            value = np.array(around[block.name], dtype=float).reshape(block.whole.shape)
            value.reshape(-1)[list(block.places)] = numbers
            found[block.name] = value
        return found

    def placed(self, flat: Array) -> Values:
        """The numbers as whole blocks, with zeros for entries that are not in the vector."""
        return self.unpack(flat, {b.name: np.zeros(b.base.shape) for b in self.parts})

    @cached_property
    def parts(self) -> tuple[Block, ...]:
        """The blocks of which only some entries are in the vector."""
        return tuple(block for block in self.blocks if block.whole is not None)

    def spelled(self, without: Iterable[str] = ()) -> tuple[str, ...]:
        """Names that mean exactly these numbers, leaving out the blocks `without`."""
        left = set(without)
        return tuple(
            name for block in self.blocks if block.name not in left for name in _names(block)
        )

    def chosen(self, places: Iterable[int]) -> "Layout":
        """A layout of the numbers in some places only, in the order of the blocks."""
        taken: dict[str, list[int]] = {}
        for place in places:
            block, i = self.block_of(int(place))
            taken.setdefault(block.name, []).append(block.places[i])
        return Layout(
            tuple(
                b.base
                if len(set(taken[b.name])) == b.base.size
                else Block.part(b.base, taken[b.name])
                for b in self.blocks
                if b.name in taken
            )
        )

    def pieces(self, flat: cs.MX) -> list[cs.MX]:
        """A symbolic vector (size, 1) cut into one matrix per block, axes reversed."""
        parts = cs.vertsplit(flat, self._edges.tolist()) if self.blocks else []
        return [
            cs.reshape(part, *b.symbol_shape) for part, b in zip(parts, self.blocks, strict=True)
        ]

    def block_of(self, index: int) -> tuple[Block, int]:
        """The block that entry `index` of the vector belongs to, and the entry's place in it."""
        if not 0 <= index < self.size:
            raise IndexError(f"entry {index} of a vector of {self.size}")
        which = int(np.searchsorted(self._edges, index, side="right")) - 1
        return self.blocks[which], index - int(self._edges[which])

    def place(self, name: str, entry: int) -> int | None:
        """The place of a block's entry in the flat vector; None if it is not in it."""
        at = self.slices.get(name)
        if at is None:
            return None
        here = self._of_parts.get(name)
        return at.start + entry if here is None else here.get(entry)

    @cached_property
    def _of_parts(self) -> dict[str, dict[int, int]]:
        return {
            b.name: {entry: self.slices[b.name].start + i for i, entry in enumerate(b.places)}
            for b in self.parts
        }

    def label(self, index: int) -> str:
        """The name of one entry of the vector: `pose[right_ankle, z]`."""
        block, entry = self.block_of(index)
        return block.name + block.entry(entry)

    def labels_of(self, places: Iterable[int]) -> list[str]:
        """The names of several entries of the vector."""
        return [self.label(int(place)) for place in places]

    def unit(self, index: int) -> str:
        """The unit of one entry of the vector."""
        return self.block_of(index)[0].unit

    def only(self, names: Iterable[str]) -> "Layout":
        """A layout of the named blocks, in the order of the names."""
        return Layout(tuple(self[name] for name in names))


def all_values(free: Layout, x: Array, fixed: Layout, given: Array) -> Values:
    """The values of all blocks, from their free and fixed numbers x and `given`.

    A block that is free in part is in both layouts; the fixed layout has the whole block.
    """
    around = fixed.unpack(given)
    return around | free.unpack(x, around)


def _names(block: Block) -> list[str]:
    if block.whole is None:
        return [block.name]
    if len(block.shape) == 2 and block.labels is not None:
        return [f"{block.name}[{label}]" for label in block.labels]
    return [block.name + block.entry(i) for i in range(block.size)]
