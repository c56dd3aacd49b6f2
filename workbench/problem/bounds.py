"""Bounds by the names of blocks and of their entries, as two flat vectors."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout
from workbench.blocks.checks import reals
from workbench.blocks.layout import places_named
from workbench.errors import BadBounds, ShapeMismatch

Bounds = Mapping[str, tuple[ArrayLike, ArrayLike]]


def flat_bounds(bounds: Bounds, free: Layout, known: Layout) -> tuple[Array, Array]:
    """Lower and upper, (n,) each, infinite where there is none.

    `known` are all blocks. Bounds are of a whole block, also where it is free in part, or of named
    entries, whose bounds count more than those of the block. Raises BadBounds for what is fixed, no
    pair, or limits that no number lies between; ShapeMismatch or NotNumbers for a limit that does
    not fit.
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
