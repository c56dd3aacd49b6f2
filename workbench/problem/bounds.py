"""Bounds by the names of blocks, as two flat vectors."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Layout
from workbench.blocks.reals import reals
from workbench.errors import BadBounds, ShapeMismatch

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[ArrayLike, ArrayLike]]


def flat_bounds(bounds: Bounds, free: Layout, fixed: Layout) -> tuple[Array, Array]:
    """Lower and upper, (n,) each, infinite where there is none.

    Raises BadBounds for a fixed block, no pair, or limits that no number lies between;
    ShapeMismatch or NotNumbers for a limit that does not fit its block.
    """
    for name in bounds:
        if name in fixed.names:
            raise BadBounds(f"block {name!r} has bounds but is fixed; free it or drop them")
    lower, upper = (_side(bounds, free, side) for side in (0, 1))
    wrong = ~(lower <= upper)  # also where one is NaN
    if wrong.any():
        i = int(np.argmax(wrong))
        raise BadBounds(
            f"{free.label(i)} has the lower bound {lower[i]:g} and the upper bound "
            f"{upper[i]:g}; no number lies between"
        )
    return lower, upper


def _side(bounds: Bounds, free: Layout, side: int) -> Array:
    flat = np.full(free.size, (-np.inf, np.inf)[side])
    for name, pair in bounds.items():
        block = free[name]
        if not isinstance(pair, (tuple, list, np.ndarray)) or len(pair) != 2:
            raise BadBounds(f"bounds of {name!r} are a pair (lower, upper), not {pair!r}")
        limit = reals(f"a bound of {name!r}", pair[side])
        try:
            flat[free.slices[name]] = np.broadcast_to(limit, block.shape).ravel()
        except ValueError:
            raise ShapeMismatch(
                f"bounds of {name}", expected=block.shape, got=limit.shape
            ) from None
    return flat
