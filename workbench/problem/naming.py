"""Checks of what a problem is made of: names of blocks, bounds and units."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout, Points
from workbench.blocks.checks import reals, several
from workbench.blocks.layout import block_of, places_named
from workbench.errors import (
    BadBlock,
    BadBounds,
    BadConstraint,
    BadResidual,
    DuplicateResidual,
    ShapeMismatch,
    TwoSymbolsOneName,
    UnknownName,
    UnreadBlock,
)
from workbench.problem.constraints import Constraint
from workbench.residuals import Residual


def parts_of(
    residuals: object, constraints: object, blocks: object
) -> tuple[tuple[Residual, ...], tuple[Constraint, ...], tuple[Block, ...]]:
    """What a problem is made of, as tuples.

    Raises BadResidual, BadConstraint or BadBlock, and DuplicateResidual for a name that two have.
    """
    parts = several("the residuals of a problem", residuals, Residual, BadResidual)
    limits = several("the constraints of a problem", constraints, Constraint, BadConstraint)
    described = several("the blocks of a problem", blocks, Block, BadBlock)
    if not parts:
        raise BadResidual("a problem needs at least one residual")
    names = [*(part.name for part in parts), *(limit.name for limit in limits)]
    for name, count in Counter(names).items():
        if count > 1:
            raise DuplicateResidual(name)
    return parts, limits, described


def rows_of(residuals: Sequence[Residual]) -> dict[str, slice]:
    """The rows of each residual in the stacked residual."""
    edges = np.cumsum([0, *(r.size for r in residuals)]).tolist()
    return {r.name: slice(*edge) for r, edge in zip(residuals, pairwise(edges), strict=True)}


def check_names(names: Iterable[str], read: Collection[str], described: Iterable[Block]) -> None:
    """Check names of blocks or entries, which residuals or constraints must read.

    Raises UnreadBlock for one of the blocks that are `described` but not read, and UnknownName for
    a name that is known from nowhere.
    """
    unread = {block.name for block in described}.difference(read)
    for entry in names:
        name = block_of(entry, read)
        if name in read:
            continue
        if name in unread:
            raise UnreadBlock(name, read)
        more = "a block that no residual and no constraint reads can be neither free nor bounded"
        raise UnknownName("block", name, read, more=more)


def free_and_fixed(known: Layout, free: Iterable[str]) -> tuple[Layout, Layout]:
    """The blocks that are named, whole or in part, in this order; and those that are not all free.

    Raises UnknownName, or BadArgument if entries of a block are named that has none.
    """
    entries: dict[str, set[int]] = {}  # that are free, by the name of their block
    for name in free:
        block = block_of(name, known.names)
        start = known.slices[block].start
        places = (place - start for place in places_named(known, name, "block"))
        entries.setdefault(block, set()).update(places)
    blocks = [
        known[name] if len(places) == known[name].size else Block.part(known[name], places)
        for name, places in entries.items()
    ]
    whole = {block.name for block in blocks if block.whole is None}
    return Layout(tuple(blocks)), Layout(tuple(b for b in known.blocks if b.name not in whole))


def blocks_behind(
    stacked: cs.MX, points: Iterable[Points], described: Iterable[Block]
) -> dict[str, Block]:
    """Every block that an expression of symbols and points reads, by name.

    The last of the blocks that are `described` for a symbol is taken. Raises TwoSymbolsOneName.
    """
    points = tuple(points)
    known = {block.symbol.__hash__(): block for block in described}
    placeholders = {p.symbol.__hash__() for p in points}
    symbols = [s for s in cs.symvar(stacked) if s.__hash__() not in placeholders]
    symbols += [block.symbol for p in points for block in p.source.blocks]
    blocks: dict[str, Block] = {}
    for symbol in {s.__hash__(): s for s in symbols}.values():
        if symbol.name() in blocks:
            raise TwoSymbolsOneName(symbol.name())
        blocks[symbol.name()] = known.get(symbol.__hash__()) or Block.of(symbol)
    return blocks


Bounds = Mapping[str, tuple[ArrayLike, ArrayLike]]


def flat_bounds(bounds: Bounds, free: Layout, known: Layout) -> tuple[Array, Array]:
    """Lower and upper, (n,) each, infinite where there is none.

    `known` are all blocks. Bounds are of a whole block, also where it is free in part, or of named
    entries, whose bounds count more. Raises BadBounds, ShapeMismatch or NotNumbers.
    """
    lower, upper = np.full(free.size, -np.inf), np.full(free.size, np.inf)
    for name in sorted(bounds, key=lambda name: name not in known.names):  # blocks first
        block = _bounded(name, known)
        places = [free.place(block.name, entry) for entry in block.places]
        if block.size and all(place is None for place in places):
            what = "block" if name in known.names else "entry"
            raise BadBounds(f"{what} {name!r} has bounds but is fixed; free it or drop them")
        for side, flat in enumerate((lower, upper)):
            limit = _limit(name, bounds[name], side, block)
            for place, value in zip(places, limit, strict=True):
                if place is not None:
                    flat[place] = value
    wrong = ~(lower <= upper)  # also where one is NaN
    if wrong.any():
        i = int(np.argmax(wrong))
        raise BadBounds(
            f"{free.label(i)} has the lower bound {lower[i]:g} and the upper bound "
            f"{upper[i]:g}; no number lies between"
        )
    return lower, upper


def of_free(bounds: Bounds, free: Layout, known: Layout) -> dict[str, tuple[ArrayLike, ArrayLike]]:
    """The bounds of which some entry is free."""
    return {
        name: pair
        for name, pair in bounds.items()
        if (block := _bounded(name, known)).name in free.names
        and (not block.size or any(free.place(block.name, e) is not None for e in block.places))
    }


def _bounded(name: str, known: Layout) -> Block:
    """The block of this name, or the part of one. Raises UnknownName."""
    if name in known.names:
        return known[name]
    places = places_named(known, name, "block")
    block, _ = known.block_of(places[0])
    return Block.part(block, [place - known.slices[block.name].start for place in places])


def _limit(name: str, pair: object, side: int, block: Block) -> Array:
    """The lower or the upper limit of a pair, flat."""
    if not isinstance(pair, (tuple, list, np.ndarray)) or len(pair) != 2:
        raise BadBounds(f"bounds of {name!r} are a pair (lower, upper), not {pair!r}")
    limit = reals(f"a bound of {name!r}", pair[side])
    try:
        return np.broadcast_to(limit, block.shape).ravel()
    except ValueError:
        raise ShapeMismatch(f"bounds of {name}", expected=block.shape, got=limit.shape) from None


NO_UNIT = "1"  # of a block of which nobody said one
SINGLE_UNIT = re.compile(r"[^\W\d_]+|[%°]")  # one that is not put together of others
MOST_PARTS, DEEPEST_PART = 1_000, 100  # of an expression that are looked at, from its end
ADDING = (cs.OP_ADD, cs.OP_SUB)
OF_ANGLES = {cs.OP_SIN: "sine", cs.OP_COS: "cosine", cs.OP_TAN: "tangent"}
DEGREES = ("deg", "degree", "degrees", "°")
MOVING = (  # operations that move numbers; a sign does not change a unit
    cs.OP_NEG,
    cs.OP_RESHAPE,
    cs.OP_TRANSPOSE,
    cs.OP_GETNONZEROS,
    cs.OP_HORZCAT,
    cs.OP_VERTCAT,
    cs.OP_HORZREPMAT,
)
_Measured = tuple[str, str]  # a unit, and the name of the block or points that it comes from


def check_units(
    parts: Iterable[Residual | Constraint], blocks: Mapping[str, Block], points: Iterable[Points]
) -> None:
    """Raise BadResidual where different units are added or subtracted, or a sine is of degrees.

    Units must be known, and those that are added single ones, as m and mm: those of blocks whose
    unit is "1" are not known, nor those of products. N m and J are the same, and m/s less m may
    have left out 1 s.
    """
    known = {b.symbol.__hash__(): (b.unit, b.name) for b in blocks.values() if b.unit != NO_UNIT}
    known |= {p.symbol.__hash__(): ("m", p.name) for p in points if p.symbol.shape[0] == 3}
    units = {unit for unit, _ in known.values()}
    if len(units) < 2 and not units & {*DEGREES}:
        return
    for part in parts:
        if not (isinstance(part, Residual) and part.by_frame):  # its frames were looked at
            what = f"{type(part).__name__.lower()} {part.name!r}"
            _unit_of(part.expression, known, what, {}, 0)


def _unit_of(
    part: cs.MX,
    known: Mapping[int, _Measured],
    what: str,
    visited: dict[int, _Measured | None],
    depth: int,
) -> _Measured | None:
    """The unit of a part of an expression, or None where it is not known."""
    key = part.__hash__()
    if key in visited or len(visited) >= MOST_PARTS or depth >= DEEPEST_PART:
        return visited.get(key)
    if part.is_symbolic():
        return known.get(key)
    visited[key] = None  # while its operands are looked at
    units = [_unit_of(part.dep(i), known, what, visited, depth + 1) for i in range(part.n_dep())]
    if part.op() in ADDING:
        first, second = units
        if first and second and first[0] != second[0]:
            if SINGLE_UNIT.fullmatch(first[0]) and SINGLE_UNIT.fullmatch(second[0]):
                raise BadResidual(
                    f"{what} adds or subtracts {first[1]!r}, in {first[0]}, and {second[1]!r}, in "
                    f"{second[0]}; give both in one unit, or convert one where it is read, as in "
                    "observed.symbol / 1000 from mm to m. Where two spellings mean one unit, take "
                    "one"
                )
        else:
            visited[key] = first or second
    elif part.op() in OF_ANGLES and units[0] and units[0][0] in DEGREES:
        raise BadResidual(
            f"{what} takes the {OF_ANGLES[part.op()]} of {units[0][1]!r}, in {units[0][0]}; "
            "multiply it by pi / 180 first, or give it in rad"
        )
    elif part.op() in MOVING and len({unit and unit[0] for unit in units}) == 1:
        visited[key] = units[0]
    return visited[key]
