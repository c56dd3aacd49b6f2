"""Bounds of blocks, as bounds of the flat vector."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Layout
from workbench.blocks.reals import reals
from workbench.errors import BadBounds, ShapeMismatch

Array = NDArray[np.float64]
Bounds = Mapping[str, tuple[ArrayLike, ArrayLike]]


def flat_bounds(bounds: Bounds, free: Layout, side: int) -> Array:
    """The lower (side 0) or upper bounds (n,), infinite where there is none.

    Raises BadBounds, ShapeMismatch or NotNumbers.
    """
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
