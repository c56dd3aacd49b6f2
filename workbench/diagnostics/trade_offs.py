"""Trade-offs: single numbers that undo each other wherever the unknowns are.

Of a sum only the whole is seen, of a mass and a distance only the product with others. The ratio in
which they undo each other need not be the same everywhere.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.blocks.directions import dominant
from workbench.diagnostics.gauge_names import listed, single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.sparse_bases import beyond, sparsest
from workbench.diagnostics.undoing import (
    SAME,
    Found,
    Unseen,
    nothing,
    only,
    places,
    places_of,
    undone_by_few,
)

SLICES = 24  # rows, columns or entries up to which each may move as others undo it in any way
PART = 1e-5  # of the largest coefficient: less takes no part
FEW = 8  # numbers that undo each other in a ratio of no known form


def trade_offs(free: Layout, blocks: Sequence[Block], unseen: Unseen) -> Iterator[NamedSubspace]:
    """A single number may have any value, since a few other unknowns undo its change.

    Of the entries of a block that is so where one other block undoes them.
    """
    for block in blocks if unseen.nearby else ():
        choices = [places_of(free, b) for b in free.blocks if b is not block]
        for at in places_of(free, block) if block.size <= SLICES else ():
            field = only(np.array([at]), free.size, lambda x: np.ones((1, 1)))
            for v, _ in undone_by_few(field, choices, unseen):
                moved = sum(1 for some in choices if abs(v[some]).max() > SAME * abs(v).max())
                if block.size == 1 or moved < 2:
                    yield trade_off(free, v)


def few_numbers(
    free: Layout, blocks: Sequence[Block], unseen: Unseen, found: Found
) -> Iterator[NamedSubspace]:
    """A few numbers of these blocks undo each other at every point, in whatever ratio.

    Which ones these are is read at the point, and at one nearby: at the point itself some may take
    no part by chance.
    """
    if not (unseen.nearby and unseen.exact and blocks):
        return
    among = places(free, blocks)
    nothing_known = np.zeros((free.size, 0))
    for elsewhere in (False, True):
        if found.all() or unseen.count > SLICES:
            return
        left, known = beyond(found.basis, unseen.basis)[0], found.basis
        if elsewhere:
            left, known = unseen.nearby[0][1], nothing_known
        for v in sparsest(left, known).T:
            some = np.flatnonzero(abs(v) > PART * abs(v).max())
            if len(some) > FEW or not np.isin(some, among).all():
                continue
            here, *there = (_within(some, basis, unseen.same) for _, basis in unseen.everywhere)
            if here.shape[1] == 1 and all(one.shape[1] for one in there):
                yield trade_off(free, here[:, 0])


def _within(some: Index, basis: Array, same: float) -> Array:
    """The unseen ways of moving (n, k) that move these places alone."""
    ways = basis @ nothing(np.delete(basis, some, axis=0), same)
    return np.where(np.isin(np.arange(len(basis)), some)[:, None], ways, 0.0)


def trade_off(free: Layout, v: Array) -> NamedSubspace:
    """`a trade-off within slide: 0.71 slide[0] - 0.71 slide[2]`, or one of several blocks."""
    entries = ((b.name, abs(v[places_of(free, b)])) for b in free.blocks)
    moved = [name for name, own in entries if own.max(initial=0.0) > SAME * abs(v).max()]
    among = f"within {moved[0]}" if len(moved) == 1 else f"of {listed(moved)}"
    largest = v[abs(v) > (1 - PART) * abs(v).max()]  # up to rounding; the first of them is positive
    unit = v * np.sign(largest[0]) / np.linalg.norm(v)
    return single_gauge("trade-off", f"a trade-off {among}: {dominant(unit, free)}", unit)
