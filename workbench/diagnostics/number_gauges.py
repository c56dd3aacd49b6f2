"""Gauges of numbers: common offsets and common factors of groups of unknowns.

Offsets and factors of single unknowns commute, so that all of them that cancel are found at once.
A combination c of the columns 1 and x_i of groups of unknowns is a gauge if residuals notice D(x) c
at no point. Groups are blocks first, then rows, columns and entries; combinations of few are taken.
"""

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import listed, named_gauge, rows_of, single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.sparse_bases import sparsest
from workbench.diagnostics.things import in_space
from workbench.diagnostics.trade_offs import PART, SLICES, trade_off
from workbench.diagnostics.undoing import (
    SAME,
    Found,
    Unseen,
    nothing,
    places_of,
    undone_by_few,
)

WITHIN = 10  # of the least share that a motion may have elsewhere: of one in many parts
MANY = 400  # groups up to which combinations of few are looked for


@dataclass(frozen=True, eq=False)
class Group:
    """Unknowns that change together: by the same amount, or in proportion to what they are.

    Attributes:
        name: such as `clock`, `row 3 of table` or `offset[0]`.
        places: (q,) where they are.
        factor: whether they change in proportion.
        block: the block that they belong to.
    """

    name: str
    places: Index = field(repr=False)
    factor: bool
    block: Block

    def column(self, x: Array, units: Array) -> Array:
        """How the unknowns (n,) move, all of them in units."""
        v = np.zeros(len(x))
        v[self.places] = x[self.places] if self.factor else 1 / units[self.places]
        return v


def number_gauges(
    free: Layout,
    blocks: Sequence[Block],
    islands: Sequence[Index],
    unseen: Unseen,
    found: Found,
    units: Array,
) -> Iterator[NamedSubspace]:
    """Offsets and factors of these blocks that cancel; `islands` are unknowns that rows tie."""
    whole = [*blocks_whole(free, blocks, islands)]
    for one in _by_kind(whole, unseen, found, units):
        # at one point alone, single numbers undo each other in ways that say nothing
        if unseen.nearby or max(group.places.size for group, _ in one.parts) > 1:
            yield from named_combination(free, one, unseen)
    if not unseen.nearby:
        return
    yield from _undone_in_any_way(free, whole, unseen, found, units)
    slices = [*_slices(free, blocks)]
    for one in _by_kind(slices, unseen, found, units):
        if not one.crosses:
            yield from named_combination(free, one, unseen)
    few = [group for group in slices if group.places.size > 1]
    yield from _undone_in_any_way(free, few, unseen, found, units)


def entry_gauges(
    free: Layout, blocks: Sequence[Block], unseen: Unseen, found: Found, units: Array
) -> Iterator[NamedSubspace]:
    """Offsets and factors of single entries that cancel."""
    for one in _by_kind([*_entries(free, blocks)] if unseen.nearby else [], unseen, found, units):
        yield from named_combination(free, one, unseen)


def common_scales(
    free: Layout,
    blocks: Sequence[Block],
    points: Set[str],
    islands: Sequence[Index],
    unseen: Unseen,
    found: Found,
    units: Array,
) -> Iterator[NamedSubspace]:
    """The factors of blocks that cancel, in which points take part: a change of scale."""
    groups = [g for g in blocks_whole(free, blocks, islands) if g.factor]
    for combination in combinations_of(groups, unseen, found, units):
        if any(group.block.name in points for group, _ in combination.parts):
            yield from named_combination(free, combination, unseen, "a scale")


def blocks_whole(
    free: Layout, blocks: Sequence[Block], islands: Sequence[Index]
) -> Iterator[Group]:
    """Blocks, as far as rows tie them; of what may be points each column may shift by itself."""
    for block in blocks:
        for island in islands:
            own = np.intersect1d(island, places_of(free, block))
            if not own.size:
                continue
            part = own.size < block.size
            name = rows_of(block, own - free.slices[block.name].start) if part else block.name
            yield Group(name, own, True, block)
            d = block.shape[-1] if in_space(block) else 1
            if d == 1:
                yield Group(name, own, False, block)
            elif own.size > d:
                for k in range(d):
                    yield Group(f"column {k} of {name}", own[k::d], False, block)


def _slices(free: Layout, blocks: Sequence[Block]) -> Iterator[Group]:
    """Rows, columns and other slices of arrays; the entries of a vector."""
    for block in blocks:
        if block.whole is not None or not block.shape:
            yield from _both(block.name, places_of(free, block), block)
            continue
        at = places_of(free, block).reshape(block.shape)
        words = ("row", "column") if at.ndim == 2 else tuple(f"slice {a}," for a in range(at.ndim))
        for axis in range(at.ndim):
            for k in range(at.shape[axis]):
                own = np.take(at, k, axis).ravel()
                one = f"{block.name}[{k}]" if at.ndim == 1 else f"{words[axis]} {k} of {block.name}"
                yield from _both(one, own, block)


def _entries(free: Layout, blocks: Sequence[Block]) -> Iterator[Group]:
    for block in blocks:
        for i in places_of(free, block):
            yield from _both(free.label(int(i)), np.array([i]), block)


def _both(name: str, own: Index, block: Block) -> Iterator[Group]:
    yield Group(name, own, True, block)
    yield Group(name, own, False, block)


@dataclass(frozen=True, eq=False)
class Combination:
    """Groups, each with its amount, that move together as v (n,)."""

    parts: Sequence[tuple[Group, float]]
    v: Array = field(repr=False)

    @property
    def crosses(self) -> bool:
        """Whether a row and a column of one block take part: then entries say it better."""
        pairs = combinations([group for group, _ in self.parts], 2)
        alike = ((a, b) for a, b in pairs if a.block is b.block and a.factor == b.factor)
        return any(np.intersect1d(a.places, b.places).size for a, b in alike)


def _by_kind(
    groups: Sequence[Group], unseen: Unseen, found: Found, units: Array
) -> Iterator[Combination]:
    """Combinations of offsets, of factors, and then of both, where more than one point is known."""
    yield from combinations_of([g for g in groups if not g.factor], unseen, found, units)
    yield from combinations_of([g for g in groups if g.factor], unseen, found, units)
    if unseen.nearby:
        yield from combinations_of(groups, unseen, found, units)


def combinations_of(
    groups: Sequence[Group], unseen: Unseen, found: Found, units: Array
) -> Iterator[Combination]:
    """The combinations of groups that cancel everywhere, those of few groups first."""
    groups = [g for g in groups if np.linalg.norm(g.column(unseen.x, units)) > 0]
    if found.all() or not groups or len(groups) > MANY:
        return

    moves = partial(_columns, groups, units)
    D = moves(unseen.x)
    size = np.linalg.norm(D, axis=0)
    C = nothing(unseen.missed(moves, size), unseen.same)
    known = np.zeros((len(C), 0))
    if unseen.exact:
        v = D / size @ C
        known = C @ nothing(v - found.basis @ (found.basis.T @ v), SAME)
    U, s, _ = np.linalg.svd(C - known @ (known.T @ C), full_matrices=False)
    each = np.sqrt([g.places.size for g in groups])  # so that a group counts once, large or small
    for c in _of_few(U[:, s > 0.5] / each[:, None], known / each[:, None]).T:
        a = c * each / size
        a[abs(a * size) < PART * abs(a * size).max()] = 0.0
        v = D @ a
        inside = unseen.basis @ (unseen.basis.T @ v)  # without the rounding of a linear program
        v = np.where(v == 0, 0.0, inside) if unseen.exact else inside
        whole = D @ a  # what is a small difference of large parts has to be a motion by itself
        lies_in = np.linalg.norm(whole - inside) <= WITHIN * unseen.same * np.linalg.norm(whole)
        if lies_in and np.linalg.norm(v) > SAME * np.linalg.norm(D * a):
            yield Combination([(g, float(b)) for g, b in zip(groups, a, strict=True) if b], v)


def _columns(groups: Sequence[Group], units: Array, x: Array) -> Array:
    """How the unknowns (n,) move with each of the groups, (n, g)."""
    return np.column_stack([group.column(x, units) for group in groups])


def _of_few(basis: Array, known: Array) -> Array:
    """Vectors of few nonzeros that, with those known, span the space of both."""
    if not basis.shape[1]:
        return basis
    basis = np.linalg.qr(basis)[0]
    known = np.linalg.qr(known)[0] if known.shape[1] else known
    return sparsest(basis, known)


def named_combination(
    free: Layout, combination: Combination, unseen: Unseen, scale: str = "a common factor"
) -> Iterator[NamedSubspace]:
    """A combination by its name: `a common factor of ability, undone by slope`."""
    parts, v = combination.parts, combination.v
    factors = [(group, c) for group, c in parts if group.factor]
    main = factors or [(g, c) for g, c in parts if g.places.size > 1] or _alike(parts)
    if not main:
        yield trade_off(free, v)
        return
    least = min((c for _, c in main), key=abs)
    first = main[0][1]
    unit = abs(least) * np.sign(first)
    same = np.isclose([abs(c) for _, c in parts], abs(least), rtol=max(PART, unseen.same)).all()
    if not unseen.nearby and not factors and not same:
        return
    kind, said = ("scale", scale) if factors else ("offset", "a common offset")
    up = [_part(g, c / unit) for g, c in main if c / unit > 0]
    down = [_part(g, -c / unit) for g, c in main if c / unit < 0]
    down += [
        g.name if not factors else f"an offset of {g.name}"
        for g, _ in parts
        if all(g is not one for one, _ in main)
    ]
    name = f"{said} of {listed(up)}" + (f", undone by {listed(down)}" if down else "")
    yield single_gauge(kind, name, v)


def _alike(parts: Sequence[tuple[Group, float]]) -> list[tuple[Group, float]]:
    """The entries of all blocks, if those of some block are several and move by the same."""
    by_block: dict[str, list[float]] = {}
    for group, c in parts:
        by_block.setdefault(group.block.name, []).append(c)
    several = [amounts for amounts in by_block.values() if len(amounts) > 1]
    alike = bool(several) and all(np.allclose(some, some[0], rtol=PART) for some in several)
    return list(parts) if alike else []


def _part(group: Group, amount: float) -> str:
    """`slope`, `size (to the power 2)` or `clock (2 times as much)`."""
    if abs(amount - 1) < 1e-3:
        return group.name
    how = f"to the power {amount:.3g}" if group.factor else f"{amount:.3g} times as much"
    return f"{group.name} ({how})"


def _undone_in_any_way(
    free: Layout, groups: Sequence[Group], unseen: Unseen, found: Found, units: Array
) -> Iterator[NamedSubspace]:
    """An offset or a factor of several unknowns that the fewest other blocks undo, in any way."""
    sizes: dict[str, int] = {}
    for group in groups:
        sizes[group.block.name] = sizes.get(group.block.name, 0) + 1
    for group in groups:
        if group.places.size < 2 or sizes[group.block.name] > 4 * SLICES:
            continue
        if not unseen.fixed(group.places) or found.does(
            group.column(unseen.x, units)[group.places], group.places
        ):
            continue
        choices = [places_of(free, b) for b in free.blocks if b is not group.block]
        kind, said = ("scale", "a common factor") if group.factor else ("offset", "a common offset")
        own = None if group.places.size == group.block.size else group.places
        for v, _ in undone_by_few(partial(_columns, [group], units), choices, unseen):
            if group.name.startswith(("row ", "column ", "slice ")):
                where = group.name.removesuffix(f" of {group.block.name}")
                yield named_gauge(
                    kind, f"{said} of {where}", v, free, [group.block], least=unseen.same
                )
            else:
                yield named_gauge(kind, said, v, free, [group.block], own, least=unseen.same)
