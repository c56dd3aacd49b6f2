"""A block: a named array of numbers, and the CasADi symbol that stands for it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from operator import index
from typing import Any, NoReturn, Self

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Mask
from workbench.blocks.checks import texts
from workbench.errors import BadArgument, BadBlock

AXES = ("x", "y", "z")


class Symbolic:
    """What is made of CasADi's symbols, which exist in one process alone."""

    def __reduce__(self) -> NoReturn:
        raise BadArgument(
            f"a {type(self).__name__} cannot be pickled, as its symbols exist in this process "
            "alone; pickle the function that makes it, or numbers such as those of a solution"
        )

    def __copy__(self) -> Self:
        new = type(self).__new__(type(self))
        new.__dict__.update(self.__dict__)
        return new

    def __deepcopy__(self, memo: object) -> Self:
        return self


@dataclass(frozen=True, eq=False)
class Block:
    """A named array of numbers with a unit, and the CasADi symbol that stands for it.

    An array of shape (N, 3), as a user sees it, is a (3, N) matrix inside CasADi: stored column by
    column, it is the same memory. A shape may be a single number. Where the block is `framed`, its
    first axis counts the frames of a sequence, and labels name the rows of each frame. Raises
    BadBlock for a shape or labels that make no sense.

    Attributes:
        name: the block's name, which labels and error messages use.
        shape: the shape of the array, as a user sees it.
        unit: what each entry measures, such as `rad`; `1` for a number without a unit.
        labels: a name for each row, or None.
        whole: the block of which this one is a part, under the same name; None for a whole block.
        entries: which entries of the whole block are in this part, counted row by row, rising.
        framed: whether the first axis counts the frames of a sequence.
    """

    name: str
    shape: tuple[int, ...] = ()
    unit: str = "1"
    labels: tuple[str, ...] | None = None
    whole: "Block | None" = None
    entries: tuple[int, ...] | None = None
    framed: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise BadBlock(f"a block's name is a text, not of type {type(self.name).__name__}")
        if self.labels is not None:
            what = f"the labels of block {self.name!r}"
            self.__dict__["labels"] = texts(what, self.labels, BadBlock)
        self.__dict__["shape"] = _lengths(self.name, self.shape)
        if self.framed and not self.shape:
            raise BadBlock(f"block {self.name!r} is one of frames, but its shape counts none")
        rows = (*self.shape[self.framed :], 1)[0]
        if self.labels is not None and len(self.labels) != rows:
            raise BadBlock(f"block {self.name!r} has {rows} rows but {len(self.labels)} labels")

    @staticmethod
    def part(whole: "Block", entries: Iterable[int]) -> "Block":
        """Some entries of a block, as a block of the same name in which each entry keeps its label.

        Rows that are taken as a whole stay rows, (k, 3); other entries are (k,).
        """
        chosen = np.array(sorted(set(entries)), dtype=np.int64)
        wide = whole.shape[-1] if len(whole.shape) == 2 else 1
        rows = np.unique(chosen // max(wide, 1))
        shape: tuple[int, ...] = (len(chosen),)
        if wide > 1 and len(chosen) == wide * len(rows):
            shape = len(rows), wide
            labels = None if whole.framed else whole.labels
            names = [labels[row] if labels else str(row) for row in rows]
        else:
            names = [whole.entry(int(i))[1:-1] for i in chosen]
        return Block(whole.name, shape, whole.unit, tuple(names), whole, tuple(chosen.tolist()))

    @property
    def base(self) -> "Block":
        """The block that this is a part of, or itself."""
        return self if self.whole is None else self.whole

    @property
    def places(self) -> Sequence[int]:
        """Where the numbers of this block stand among those of the `base`."""
        return range(self.size) if self.entries is None else self.entries

    def taken(self, value: ArrayLike) -> Array:
        """Its numbers, of its own shape, out of a value of the `base`."""
        flat = np.asarray(value, dtype=float).reshape(-1)
        return (flat if self.entries is None else flat[list(self.entries)]).reshape(self.shape)

    @property
    def size(self) -> int:
        """The number of entries."""
        return prod(self.shape)

    @property
    def symbol_shape(self) -> tuple[int, int]:
        """The axes reversed: (N, 3) -> 3 x N, (B,) -> B x 1, () -> 1 x 1."""
        if len(self.shape) < 2:
            return self.size, 1
        return self.shape[-1], prod(self.shape[:-1])

    @cached_property
    def symbol(self) -> cs.MX:
        """The symbol of this block, made once; two blocks never share one.

        The symbol of a part consists of these entries of the whole block's symbol.
        """
        if self.whole is not None:
            entries = cs.vec(self.whole.symbol)[list(self.places)]
            return cs.reshape(entries, *self.symbol_shape)
        return cs.MX.sym(self.name, *self.symbol_shape)

    def entry(self, index: int) -> str:
        """The name of one entry within the block: `[right_ankle, z]`, `[3]`; empty for a scalar."""
        if not self.shape:
            return ""
        *rows, last = (int(i) for i in np.unravel_index(index, self.shape))
        names = [str(i) for i in (*rows, last)]
        if self.labels is not None:
            names[self.framed] = self.labels[(*rows, last)[self.framed]]
        if rows and self.shape[-1] == 3:
            names[-1] = AXES[last]
        return f"[{', '.join(names)}]"

    def where(self, mask: Mask) -> str:
        """The name of the first true entry of an array of this block's shape."""
        return self.entry(int(np.argmax(mask.ravel()))) or "its only entry"

    def __getstate__(self) -> dict[str, Any]:
        """All but the symbol: it does not pickle, and a copy is another block."""
        return {name: value for name, value in self.__dict__.items() if name != "symbol"}

    @staticmethod
    def of(symbol: cs.MX, unit: str = "1", labels: tuple[str, ...] | None = None) -> "Block":
        """The block that a bare symbol stands for; a symbol alone tells no unit and no labels."""
        rows, columns = symbol.shape
        shape = (rows,) if columns == 1 else (columns, rows)
        block = Block(symbol.name(), () if shape == (1,) else shape, unit, labels)
        block.__dict__["symbol"] = symbol
        return block


def _lengths(name: str, shape: object) -> tuple[int, ...]:
    """The lengths of the axes; one number is one axis."""
    try:
        lengths = tuple(map(index, shape if isinstance(shape, Iterable) else (shape,)))
    except TypeError:
        lengths = (-1,)
    if any(n < 0 for n in lengths):
        raise BadBlock(
            f"block {name!r} has the shape {shape!r}, but a shape is whole numbers from 0 on, "
            "such as 3, (24, 3) or () for a single number"
        )
    return lengths
