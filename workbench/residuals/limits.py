"""Numbers that should stay between limits, at a price."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Block
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.residual import Residual


def limits(
    block: Block, lower: ArrayLike, upper: ArrayLike, *, sigma: float, name: str | None = None
) -> Residual:
    """How far each entry of a block lies outside of its limits: x - upper above, x - lower below.

    Between its limits an entry has the residual 0. Outside of them the cost grows quadratically,
    with `sigma` in the unit of the block; bounds of a problem, by comparison, are never violated.
    Lower and upper have the block's shape or broadcast to it; those that are infinite are no
    limits, and entries without any have no row. `joint_limits().bounds(pose)` gives such limits of
    a pose.

    Raises BadResidual for limits that do not fit the block, for a lower one above the upper one,
    and if there are none.
    """
    name = name or f"limits({block.name})"
    found = []
    for side, given in (("lower", lower), ("upper", upper)):
        numbers = reals(f"residual {name!r}: the {side} limits", given)
        try:
            found.append(np.broadcast_to(numbers, block.shape).ravel())
        except ValueError:
            raise BadResidual(
                f"residual {name!r} needs {side} limits of the shape {block.shape}, or one for "
                f"all, not {numbers.shape}"
            ) from None
    low, high = found
    if not (low <= high).all():  # also where one is NaN
        i = int(np.argmin(low <= high))
        raise BadResidual(
            f"residual {name!r}: {block.name}{block.entry(i)} has the lower limit {low[i]:g} and "
            f"the upper limit {high[i]:g}; no number lies between"
        )
    rows = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
    if not len(rows):
        raise BadResidual(f"residual {name!r} has no finite limit; give one, or leave it out")
    x = cs.vec(block.symbol)[rows.tolist()]
    above = cs.fmax(0, x - cs.DM(high[rows]))
    below = cs.fmin(0, x - cs.DM(low[rows]))
    labels = tuple(block.entry(int(i))[1:-1] for i in rows)
    return Residual(name, above + below, sigma, block.unit, labels=labels, blocks=(block,))
