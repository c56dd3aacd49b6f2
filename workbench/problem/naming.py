"""The parts and the names that a problem is given, checked against the blocks that it reads."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

import casadi as cs
import numpy as np

from workbench.blocks import Block, Layout, Points
from workbench.blocks.checks import several
from workbench.blocks.layout import block_of, places_named
from workbench.errors import (
    BadBlock,
    BadConstraint,
    BadResidual,
    DuplicateResidual,
    TwoSymbolsOneName,
    UnknownName,
    UnreadBlock,
)
from workbench.problem.constraint import Constraint
from workbench.residuals import Residual

Part = TypeVar("Part", Residual, Constraint)


def parts_of(
    residuals: object, constraints: object, blocks: object
) -> tuple[tuple[Residual, ...], tuple[Constraint, ...], tuple[Block, ...]]:
    """What a problem is made of, as tuples.

    Raises BadResidual, BadConstraint or BadBlock, and DuplicateResidual for a name that two have.
    """
    found = (
        several("the residuals of a problem", residuals, Residual, BadResidual),
        several("the constraints of a problem", constraints, Constraint, BadConstraint),
        several("the blocks of a problem", blocks, Block, BadBlock),
    )
    if not found[0]:
        raise BadResidual("a problem needs at least one residual")
    names = [*(r.name for r in found[0]), *(c.name for c in found[1])]
    for name, count in Counter(names).items():
        if count > 1:
            raise DuplicateResidual(name)
    return found


def rows_of(residuals: Sequence[Residual]) -> dict[str, slice]:
    """The rows of each residual in the stacked residual."""
    edges = np.cumsum([0, *(r.size for r in residuals)]).tolist()
    return {r.name: slice(*edge) for r, edge in zip(residuals, pairwise(edges), strict=True)}


def part_at(parts: Sequence[Part], row: int) -> tuple[Part, int]:
    """To which of some stacked parts a row belongs, and which of its rows it is.

    Raises IndexError.
    """
    left = row
    for part in parts:
        if 0 <= left < part.size:
            return part, left
        left -= part.size
    raise IndexError(f"row {row} of {row - left}")


def check_names(asked: Iterable[str], read: Collection[str], named: Iterable[Block]) -> None:
    """Raise UnreadBlock for a name among the blocks that are `named` but not read, UnknownName for
    one that is known from nowhere.
    """
    described = {block.name for block in named}
    for entry in asked:
        name = block_of(entry, read)
        if name in read:
            continue
        if name in described:
            raise UnreadBlock(name, read)
        more = "a block that no residual and no constraint reads can be neither free nor bounded"
        raise UnknownName("block", name, read, more=more)


def free_and_fixed(known: Layout, free: Iterable[str]) -> tuple[Layout, Layout]:
    """The blocks that are named, whole or in part, in this order; and those that are not all free.

    Raises UnknownName, or BadArgument if entries of a block are named that has none.
    """
    taken: dict[str, set[int]] = {}
    for name in free:
        block = block_of(name, known.names)
        start = known.slices[block].start
        taken.setdefault(block, set()).update(i - start for i in places_named(known, name, "block"))
    chosen = [
        known[name] if len(entries) == known[name].size else Block.part(known[name], entries)
        for name, entries in taken.items()
    ]
    whole = {block.name for block in chosen if block.whole is None}
    return Layout(tuple(chosen)), Layout(tuple(b for b in known.blocks if b.name not in whole))


def blocks_behind(
    stacked: cs.MX, points: Iterable[Points], described: Iterable[Block]
) -> dict[str, Block]:
    """Every block that an expression of symbols and points reads, by name.

    The last of the blocks that are `described` for a symbol is taken. Raises TwoSymbolsOneName.
    """
    points = tuple(points)
    known = {block.symbol.__hash__(): block for block in described}
    placeholders = {p.symbol.__hash__() for p in points}
    found = [s for s in cs.symvar(stacked) if s.__hash__() not in placeholders]
    found += [block.symbol for p in points for block in p.source.blocks]
    blocks: dict[str, Block] = {}
    for symbol in {s.__hash__(): s for s in found}.values():
        if symbol.name() in blocks:
            raise TwoSymbolsOneName(symbol.name())
        blocks[symbol.name()] = known.get(symbol.__hash__()) or Block.of(symbol)
    return blocks


def distinct(points: Iterable[Points]) -> tuple[Points, ...]:
    """The points without repetition."""
    return tuple({p.symbol.__hash__(): p for p in points}.values())
