"""Gauges that slide along what other unknowns say: along an own axis, along a direction.

A cylinder slides along its axis, and a point along the line that it stands for. How these move
depends on the values of other blocks, which do not move themselves.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.frame_gauges import ANGLES, by_one
from workbench.diagnostics.gauge_names import single_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.things import LENGTHS, stem
from workbench.diagnostics.trade_offs import SLICES
from workbench.diagnostics.undoing import Field, Found, Unseen, places_of, undone
from workbench.geometry.rotation import matrix_from_vector

PAIRS = 200  # of blocks that are looked at


def own_axis_gauges(
    free: Layout, blocks: Sequence[Block], unseen: Unseen, found: Found
) -> Iterator[NamedSubspace]:
    """Places move along an axis of their own frames; nothing undoes that, or one other block."""
    turns = [b for b in blocks if b.unit in ANGLES]
    spatial = [b for b in blocks if b.unit in LENGTHS[1:] and b.shape]
    pairs = [(t, p) for t in turns for p in spatial if _a_frame(t, p)]
    for turn, place in pairs[:PAIRS] if unseen.nearby else ():
        at = places_of(free, place)
        for back, axis in ((False, "its own"), (True, "an axis that turns to")):
            field = _along_own(places_of(free, turn), at, place.shape[-1], back=back)
            said = f"a translation along {axis}"
            yield from by_one("translation", said, field, place, free, unseen, found)


def _a_frame(turn: Block, place: Block) -> bool:
    """Whether the one may turn the frames of which the other says the places."""
    d, alike = place.shape[-1], stem(turn.name) == stem(place.name)
    turns = turn.shape == (place.shape if d == 3 else place.shape[:-1])
    return alike and d in (2, 3) and turns


def _along_own(turn: Index, place: Index, d: int, *, back: bool) -> Field:
    """Places move by R c, or by R'c, with the rotation R of their frame: for c along the axes."""

    def moves(x: Array) -> Array:
        if d == 3:
            R = matrix_from_vector(x[turn].reshape(-1, 3))
        else:
            c, s = np.cos(x[turn]), np.sin(x[turn])
            R = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
        found = np.zeros((len(x), d))
        found[place] = (R.swapaxes(1, 2) if back else R).reshape(-1, d)
        return found

    return moves


def added_gauges(
    free: Layout, blocks: Sequence[Block], unseen: Unseen, found: Found
) -> Iterator[NamedSubspace]:
    """One array, or a row of it, may be added to another of the same shape, and nothing sees it."""
    whole = [b for b in blocks if b.whole is None and b.shape and b.size > 1]
    pairs = [(a, b) for a, b in permutations(whole, 2) if a.shape == b.shape]
    for one, to in pairs[:PAIRS] if unseen.nearby else ():
        own, at = places_of(free, one), places_of(free, to)
        if not found.left(at):
            continue
        every = [(own, at, f"{one.name} added to {to.name}")]
        if len(to.shape) == 2 and to.shape[0] <= SLICES:
            rows = zip(own.reshape(to.shape), at.reshape(to.shape), strict=True)
            every += [
                (row, there, f"row {k} of {one.name} added to row {k} of {to.name}")
                for k, (row, there) in enumerate(rows)
            ]
        for row, there, name in every:
            for v, _ in undone(_adding(row, there), at[:0], unseen):
                yield single_gauge("mixing", name, v)


def _adding(own: Index, at: Index) -> Field:
    """The numbers at the places `at` move by those at `own`."""

    def moves(x: Array) -> Array:
        found = np.zeros((len(x), 1))
        found[at, 0] = x[own]
        return found

    return moves
