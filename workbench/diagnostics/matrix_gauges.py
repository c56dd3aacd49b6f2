"""Gauges of matrices of coefficients: columns, or rows, are scaled, mixed and shifted.

A E, with A (N, h), is undone by other unknowns for the matrices E (h, h) of some space, the same at
every point. Which space this is says what A is: all E belong to a factor of a product, diagonal ones
to a factor before something nonlinear or to a channel with a gain, skew ones to axes that nothing
fixes. The elementary ones come first: a factor of one column, one column added to another.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout
from workbench.diagnostics.gauge_names import named_gauge
from workbench.diagnostics.named_subspaces import NamedSubspace
from workbench.diagnostics.undoing import (
    Unseen,
    common,
    only,
    places_of,
    undoing,
    undone_maps,
)

MOST = 600  # numbers in the matrix E
LARGEST = 400  # rows, or columns, of which factors are looked for


def matrix_gauges(
    free: Layout, unseen: Unseen, block: Block, units: Array, *, points: bool
) -> Iterator[NamedSubspace]:
    """The motions of a block (N, h) that act on its columns alike, or on its rows.

    Of `points`, whose columns turn together, only rows are looked at, and those are only scaled.
    """
    at = places_of(free, block)
    if len(block.shape) != 2 or min(block.shape) < 2 or not unseen.fixed(at):
        return
    order = np.arange(block.size).reshape(block.shape)
    sides = [("row", at[order.T.ravel()], block.shape[0])]
    sides = sides if points else [("column", at, block.shape[1]), *sides]
    for what, places, h in sides:
        if h <= LARGEST:
            yield from _along(free, unseen, block, units, places, h, what, points=points)


def _along(
    free: Layout,
    unseen: Unseen,
    block: Block,
    units: Array,
    places: Index,
    h: int,
    what: str,
    *,
    points: bool,
) -> Iterator[NamedSubspace]:
    """The motions A E and A + 1 c', of A (N, h) at these places row by row."""
    mixed = not points and h * h <= MOST
    pairs = [(i, i) for i in range(h)]
    pairs += [(i, j) for i, j in np.ndindex(h, h) if i != j] if mixed else []
    unit = 1 / units[places[0]]

    def moves(x: Array) -> Array:
        A = x.reshape(-1, h)
        found = np.zeros((len(A), h, len(pairs) + (0 if points else h)))
        for k, (i, j) in enumerate(pairs):
            found[:, j, k] = A[:, i]
        for k in range(len(pairs), found.shape[2]):
            found[:, k - len(pairs), k] = unit
        return found.reshape(-1, found.shape[2])

    others = np.setdiff1d(np.arange(free.size), places)
    Q, whole = undoing(only(places, free.size, moves), others, unseen)
    if not Q.shape[1]:
        return
    for kind, said, a in _named_maps(Q, h, pairs, what):
        v = whole(a)
        if v.any():
            yield named_gauge(kind, said, v, free, [block], least=unseen.same)


def _named_maps(
    Q: Array, h: int, pairs: list[tuple[int, int]], what: str
) -> Iterator[tuple[str, str, Array]]:
    """Coefficients (g,) that span the space Q (g, q) of maps, each with its kind and its words."""
    unit, count = np.eye(len(Q)), len(pairs)
    place = {pair: k for k, pair in enumerate(pairs)}
    for k, (inside, (i, j)) in enumerate(zip(undone_maps(Q, unit[:, :count]), pairs, strict=True)):
        if inside:
            words = f"a factor of {what} {i}" if i == j else f"{what} {i} added to {what} {j}"
            yield ("scale" if i == j else "mixing"), words, unit[k]
    for k, inside in enumerate(undone_maps(Q, unit[:, count:])):
        if inside:
            yield "offset", f"a common offset of {what} {k}", unit[count + k]
    same = unit[:, :h].sum(axis=1)
    if undone_maps(Q, same[:, None])[0]:
        yield "scale", "a common factor", same
    for a in common(Q, unit[:, :h]).T:
        yield "scale", f"factors of the {what}s", a
    planes = [] if count == h else [*combinations(range(h), 2)]
    if planes:
        turns = np.column_stack([unit[place[i, j]] - unit[place[j, i]] for i, j in planes])
        turns /= 2**0.5
        for (i, j), inside, a in zip(planes, undone_maps(Q, turns), turns.T, strict=True):
            if inside:
                yield "rotation", f"a rotation of {what}s {i} and {j}", a
        for a in common(Q, turns).T:
            yield "rotation", f"a rotation of the {what}s", a
    for a in common(Q, unit[:, count:]).T:
        yield "offset", f"offsets of the {what}s", a
    for a in Q.T:
        yield "mixing", f"a linear map of the {what}s", a
