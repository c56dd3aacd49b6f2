"""Numbers that should stay between limits, at a price."""

from collections.abc import Callable, Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Block
from workbench.blocks.checks import reals
from workbench.errors import BadResidual
from workbench.residuals.arguments import named
from workbench.residuals.residual import Residual, check_symbolic


def limits(
    of: Block | cs.MX,
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    sigma: float,
    name: str | None = None,
    unit: str = "1",
    labels: Sequence[str] | None = None,
) -> Residual:
    """How far each number lies outside of its limits: x - upper above, x - lower below.

    Between its limits a number has the residual 0. Outside of them the cost grows quadratically,
    with `sigma` in the unit of the numbers; bounds of a problem, by comparison, are never violated.
    The numbers are the entries of a block, or a column (n, 1) of expressions, whose `unit` and
    `labels` are given. Lower and upper have the shape of the block, or (n,), or broadcast to it;
    those that are infinite are no limits, and numbers without any have no row.
    `joint_limits().bounds(pose)` gives such limits of a pose.

    Raises BadResidual for limits that do not fit the numbers, for a lower one above the upper one,
    and if there are none.
    """
    name = name or named("limits", of.symbol if isinstance(of, Block) else of)
    x, shape, what = _numbers(name, of, labels)
    found = []
    for side, given in (("lower", lower), ("upper", upper)):
        numbers = reals(f"residual {name!r}: the {side} limits", given)
        try:
            found.append(np.broadcast_to(numbers, shape).ravel())
        except ValueError:
            raise BadResidual(
                f"residual {name!r} needs {side} limits of the shape {shape}, or one for "
                f"all, not {numbers.shape}"
            ) from None
    low, high = found
    if not (low <= high).all():  # also where one is NaN
        i = int(np.argmin(low <= high))
        raise BadResidual(
            f"residual {name!r}: {what(i)} has the lower limit {low[i]:g} and "
            f"the upper limit {high[i]:g}; no number lies between"
        )
    rows = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
    if not len(rows):
        raise BadResidual(f"residual {name!r} has no finite limit; give one, or leave it out")
    x = x[rows.tolist()]
    above = cs.fmax(0, x - cs.DM(high[rows]))
    below = cs.fmin(0, x - cs.DM(low[rows]))
    if isinstance(of, Block):
        own = tuple(of.entry(int(i))[1:-1] for i in rows)
        return Residual(name, above + below, sigma, of.unit, labels=own, blocks=(of,))
    kept = None if labels is None else tuple(labels[i] for i in rows.tolist())
    return Residual(name, above + below, sigma, unit, labels=kept)


def _numbers(
    name: str, of: Block | cs.MX, labels: Sequence[str] | None
) -> tuple[cs.MX, tuple[int, ...], Callable[[int], str]]:
    """The numbers as a column, their shape as a user sees it, and what entry i is called."""
    if isinstance(of, Block):
        return cs.vec(of.symbol), of.shape, lambda i: f"{of.name}{of.entry(i)}"
    check_symbolic(f"what residual {name!r} limits", of)
    n = int(of.shape[0])
    if of.shape[1] != 1 or (labels is not None and len(labels) != n):
        raise BadResidual(
            f"residual {name!r} limits a column (n, 1) with one label for each row, not "
            f"{of.shape} with {'no' if labels is None else len(labels)} labels; casadi.vec makes a "
            "column"
        )
    return of, (n,), lambda i: f"number {i}" if labels is None else labels[i]
