"""Smoothness: values that change little from frame to frame."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Block, Points
from workbench.blocks.checks import reals
from workbench.errors import BadArgument, BadResidual
from workbench.residuals.frames import Between, Frames
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def smooth(
    what: str | Points,
    *,
    sigma: ArrayLike,
    order: int = 1,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Between:
    """A residual between the frames of a sequence: differences of `order` 1 or 2 are near zero,

        x[t + 1] - x[t]            at constant values, or
        x[t + 2] - 2 x[t + 1] + x[t]      at constant speed,

    for t from 0 on. x is a block of each frame, by its name, or points of a frame, in metres.
    `sigma` is the standard deviation of a difference, in the unit of x: one number, or one for each
    entry of a frame. Rotation vectors are taken as numbers: that is right while they stay away from
    half a turn, where the same rotation has two of them.

    The result makes the residual once it is given the frames, as `sequence(...)` does. That raises
    UnknownName for a block that no frame has, and BadResidual for a block that all frames share and
    for fewer frames than a difference takes. Raises BadArgument for another order.
    """
    if order not in (1, 2):
        raise BadArgument(f"differences between frames are of order 1 or 2, not {order!r}")
    if not isinstance(what, str | Points):
        raise BadArgument(
            "what is smooth is the name of a block of each frame, or Points of a frame, not "
            f"something of type {type(what).__name__}"
        )

    of = what.name if isinstance(what, Points) else what
    called = f"smooth({of})" if order == 1 else f"smooth({of}, order 2)"
    given = reals(f"the sigma of residual {name or called!r}", sigma)
    if not ((given > 0) & np.isfinite(given)).all():
        raise BadResidual(
            f"residual {name or called!r} needs a finite sigma above zero, not {given}"
        )

    def between(frames: Frames) -> Residual:
        read: tuple[Points, ...] = ()
        blocks: tuple[Block, ...] = ()
        if isinstance(what, Points):
            whole = frames.points(what)
            values, measured, read = whole.symbol, "m", (whole,)
            names = what.labels or tuple(map(str, range(what.count)))
            labels = [f", {point}, {axis}" for point in names for axis in "xyz"]
        else:
            block = frames[what]
            if not block.framed:
                raise BadResidual(
                    f"all frames share the block {what!r}, so nothing changes between them; "
                    "smoothness is of a block that each frame has for itself, or of points"
                )
            values, measured, blocks = block.symbol, block.unit, (block,)
            labels = _entries(block)
        T = frames.count
        if order >= T:
            raise BadResidual(
                f"differences of order {order} take {order + 1} frames, and there are {T}"
            )
        x = cs.reshape(values, values.numel() // T, T)  # a column for each frame
        difference = x[:, 1:] - x[:, :-1]
        if order == 2:
            difference = difference[:, 1:] - difference[:, :-1]
        size = int(difference.shape[0])
        if given.size not in (1, size):
            raise BadResidual(
                f"residual {name or called!r} takes one sigma, or one for each of the {size} "
                f"entries of a frame, not {given.size} of them"
            )
        return Residual(
            name or called,
            cs.vec(difference),
            np.tile(given.ravel(), T - order) if given.size > 1 else float(given.ravel()[0]),
            measured,
            kernel,
            read,
            tuple(f"{t} to {t + order}{of}" for t in range(T - order) for of in labels),
            blocks=blocks,
        )

    return between


def _entries(block: Block) -> list[str]:
    """`, left_knee, x` for each entry of a frame."""
    size = block.size // block.shape[0]
    inner = (block.entry(i)[1:-1].partition(", ")[2] for i in range(size))
    return [f", {label}" if label else "" for label in inner]
