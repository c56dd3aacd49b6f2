"""Arguments of residuals: points, observations, confidences; and the names made from them."""

from collections.abc import Sequence

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Index
from workbench.blocks import Block, Points
from workbench.blocks.checks import numbers, reals
from workbench.errors import BadResidual
from workbench.residuals.residual import check_symbolic


def expressed(points: Points | cs.MX) -> tuple[cs.MX, tuple[Points, ...]]:
    """Points or a bare matrix (3, N), as an expression and what it reads; raises BadResidual."""
    if isinstance(points, Points):
        return points.symbol, (points,)
    check_symbolic("the points of a residual", points)
    if points.shape[0] != 3:
        raise BadResidual(
            f"the points of a residual are a matrix (3, N), one column each, not {points.shape}; "
            + ("transpose it" if points.shape[1] == 3 else "take the symbol of a block (N, 3)")
        )
    return points, ()


def given(name: str, what: str, value: cs.MX | ArrayLike, shape: tuple[int, ...]) -> cs.MX:
    """Observations with their axes reversed: a symbol as it is, numbers of `shape` as a constant.

    Raises NotNumbers, or BadResidual for an array of another shape or with a row that is not
    finite.
    """
    if isinstance(value, cs.MX):
        return value
    if isinstance(value, (Block, Points)):
        check_symbolic(f"residual {name!r}: {what}", value)
    if isinstance(value, cs.DM):
        value = np.asarray(value).T  # as a user sees it
        value = value[0] if len(shape) == len(value) == 1 else value
    found = reals(f"residual {name!r}: {what}", value)
    if found.shape != shape:
        raise BadResidual(
            f"residual {name!r} needs {what} as a block's symbol or an array of shape {shape}, "
            f"not of {found.shape}"
        )
    bad = ~np.isfinite(found).all(axis=tuple(range(1, found.ndim)))
    if bad.any():
        row = int(np.argmax(bad))
        raise BadResidual(
            f"residual {name!r}: row {row} of {what} is {found[row]}, and {bad.sum()} of "
            f"{len(found)} rows are not finite; leave them out, or give them confidence 0 and "
            "any number where there is a confidence"
        )
    return cs.MX(cs.DM(found.T))


def confidences(name: str, value: cs.MX | ArrayLike, count: int, what: str) -> cs.MX:
    """Confidences (count, 1) of so many keypoints or the like, which `what` names.

    Raises NotNumbers, or BadResidual for another number of them.
    """
    found = given(name, "the confidence", value, (count,))
    if found.shape != (count, 1):
        raise BadResidual(
            f"residual {name!r} has {count} {what}, but confidences of shape {found.shape}; give "
            "one for each"
        )
    return found


def numbered(name: str, what: str, value: ArrayLike, width: int, count: int) -> Index:
    """Numbers of vertices (M, width), checked: each is from 0 to `count` - 1.

    `what` is `pairs (E` or the like. Raises NotNumbers or BadResidual.
    """
    plural = what.partition(" ")[0]
    found = numbers(f"residual {name!r}: {plural}", value)
    if found.ndim != 2 or found.shape[1] != width or found.dtype.kind not in "iu":
        raise BadResidual(
            f"residual {name!r} needs {what}, {width}) of whole numbers, not an array of shape "
            f"{found.shape} of {found.dtype}"
        )
    if found.size and not 0 <= found.min() <= found.max() < count:
        raise BadResidual(f"residual {name!r} needs vertices from 0 to {count - 1} in its {plural}")
    return found.astype(np.int64)


def row_labels(points: Points | cs.MX, axes: Sequence[str]) -> tuple[str, ...] | None:
    """Labels such as `left_wrist, x` for each coordinate of points that have names."""
    names = points.labels if isinstance(points, Points) else None
    return None if names is None else tuple(f"{n}, {a}" for n in names for a in axes)


def named(function: str, *symbols: cs.MX) -> str:
    """A name such as `function(block, block)`, from the blocks that the symbols depend on."""
    blocks = dict.fromkeys(s.name() for symbol in symbols for s in cs.symvar(symbol))
    return f"{function}({', '.join(blocks)})"


def named_after(function: str, observed: cs.MX | ArrayLike, points: Points | cs.MX) -> str:
    """A name as by `named`, from the observed block or else from the blocks of the points."""
    if isinstance(observed, cs.MX):
        return named(function, observed)
    if isinstance(points, Points):
        return f"{function}({', '.join(block.name for block in points.source.blocks)})"
    return named(function, points)


def same_shape(name: str, expression: cs.MX, observed: cs.MX) -> None:
    """Raise BadResidual unless the two can be subtracted entry by entry."""
    if expression.shape != observed.shape:
        (a, n), (b, m) = expression.shape, observed.shape
        turned = expression.shape == observed.shape[::-1]
        raise BadResidual(
            f"residual {name!r} compares {n} points ({n}, {a}) with a block of shape ({m}, {b}); "
            + (
                f"it is transposed: the symbol of a block ({n}, {a}) is a matrix ({a}, {n}), and "
                "is given as it is, as observed.symbol without .T"
                if turned
                else "they must be the same"
            )
        )
