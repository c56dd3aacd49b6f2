"""The one shape that every error term has."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.blocks import Block, Points, in_blocks
from workbench.blocks.checks import several, texts
from workbench.blocks.points import unlisted
from workbench.blocks.reals import reals
from workbench.errors import BadResidual
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.weights import check_weights, root


@dataclass(frozen=True, eq=False)
class Residual:
    """A named column that should be near zero, ordinary at `sigma`, both in `unit`.

    Problems see it whitened: row i adds 1/2 w_i rho((r_i / sigma_i)^2) to the cost, which is
    dimensionless and minus a log likelihood up to a constant. The weight w_i is a count and has no
    unit: a row of weight 2 counts as if it had been observed twice, one of weight 0 not at all. It
    stands outside of the kernel, so it does not change which residuals the kernel takes for
    outliers. `points` are the placeholders that the expression reads; `labels` name its rows.

    The expression is written in placeholders of points: casadi.jacobian of it by a body's pose
    has no nonzeros, for a placeholder is a symbol of its own. `in_blocks` is the same in the
    symbols of blocks. `blocks` describe symbols that the expression reads, by unit and labels.

    Raises BadResidual if it is no column of symbols, reads a placeholder that is not among its
    points, has no positive and finite sigma, weights that are negative or do not fit, or a kernel
    that is no function; NotNumbers for a sigma or weights of text and the like.
    """

    name: str
    expression: cs.MX  # (m, 1) in `unit`
    sigma: float | NDArray[np.float64]  # one for all rows, or (m,), in `unit`
    unit: str = "1"
    kernel: Kernel = quadratic
    points: tuple[Points, ...] = ()
    labels: tuple[str, ...] | None = None
    weights: cs.MX | ArrayLike | None = None  # one for all rows, or (m,); None: 1
    blocks: tuple[Block, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise BadResidual(f"a residual's name is a text, not {self.name!r}")
        check_symbolic(f"residual {self.name!r}: the expression", self.expression)
        what = f"of residual {self.name!r}"
        self.__dict__["points"] = several(f"the points {what}", self.points, Points, BadResidual)
        self.__dict__["blocks"] = several(f"the blocks {what}", self.blocks, Block, BadResidual)
        if self.labels is not None:
            self.__dict__["labels"] = texts(f"the labels {what}", self.labels, BadResidual)
        if self.expression.shape[1] != 1:
            raise BadResidual(
                f"residual {self.name!r} must be a column (m, 1), not {self.expression.shape}; "
                "casadi.vec makes one"
            )
        sigma = reals(f"the sigma of residual {self.name!r}", self.sigma)
        fits = sigma.shape in ((), (self.size,))
        if not fits or not ((sigma > 0) & np.isfinite(sigma)).all():
            raise BadResidual(
                f"residual {self.name!r} needs a finite sigma above zero in {self.unit}, one or "
                f"{self.size} of them, not {self.sigma}"
            )
        if not callable(self.kernel):
            raise BadResidual(
                f"residual {self.name!r} needs a function as its kernel, such as quadratic, "
                f"geman_mcclure or huber(1.345), not {self.kernel!r}"
            )
        if self.labels is not None and len(self.labels) != self.size:
            raise BadResidual(
                f"residual {self.name!r} has {self.size} rows but {len(self.labels)} labels"
            )
        check_weights(self.name, self.weights, self.size)
        check_listed(f"residual {self.name!r}", self.expression, self.points)

    @property
    def size(self) -> int:
        """m."""
        return int(self.expression.shape[0])

    @property
    def whitened(self) -> cs.MX:
        """In sigmas, shrunk by the kernel and then weighted: sqrt(w) g(s) r / sigma, (m, 1)."""
        r = self.expression / cs.DM(self.sigma)
        shrunk = r if self.kernel is quadratic else self.kernel(r**2) * r
        return shrunk if self.weights is None else root(self.weights) * shrunk

    @property
    def in_blocks(self) -> cs.MX:
        """The expression in the symbols of blocks alone, (m, 1) in `unit`.

        It can be differentiated with respect to them.

        See `blocks.in_blocks` for how. Of the whole problem, whitened, `Problem.derivative` is
        the Jacobian by all free numbers.
        """
        return in_blocks(self.expression, self.points)

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that it depends on, directly or through its points."""
        if not isinstance(self.weights, cs.MX):
            return blocks_read(self.expression, self.points)
        return blocks_read(cs.veccat(self.expression, self.weights), self.points)

    def label(self, row: int) -> str:
        """The name of one row: `keypoints(camera 1/observed)[left_wrist, u]`."""
        return f"{self.name}[{self.labels[row] if self.labels else row}]"


def blocks_read(expression: cs.MX, points: Sequence[Points]) -> tuple[str, ...]:
    """Names of the blocks that an expression of symbols and points depends on."""
    placeholders = {p.symbol.__hash__() for p in points}
    own = (s for s in cs.symvar(expression) if s.__hash__() not in placeholders)
    names = [s.name() for s in own]
    names += [b.name for p in points for b in p.source.blocks]
    return tuple(dict.fromkeys(names))


def check_symbolic(what: str, value: object) -> None:
    """Raise BadResidual unless the value is a CasADi symbol or an expression of symbols."""
    if not isinstance(value, cs.MX):
        hint = "; take its .symbol" if isinstance(value, (Block, Points)) else ""
        raise BadResidual(
            f"{what} must be a CasADi symbol or expression (MX), not something of type "
            f"{type(value).__name__}{hint}"
        )


def check_listed(what: str, expression: cs.MX, points: Sequence[Points]) -> None:
    """Raise BadResidual if an expression reads points of a body that are not among its `points`."""
    for name in unlisted(expression, points):
        raise BadResidual(
            f"{what} reads {name}, a symbol that stands for points of a body, but does not say "
            "which; give the Points themselves, as in points=(points,), and not their .symbol alone"
        )


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
    """What was observed, axes reversed: a symbol as it is, numbers of `shape` as a constant.

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


def row_labels(points: Points | cs.MX, axes: Sequence[str]) -> tuple[str, ...] | None:
    """`left_wrist, x` for each coordinate of points that have names."""
    names = points.labels if isinstance(points, Points) else None
    return None if names is None else tuple(f"{n}, {a}" for n in names for a in axes)


def named(function: str, *symbols: cs.MX) -> str:
    """`function(block, block)`; pieces and expressions go by the blocks that they read."""
    blocks = dict.fromkeys(s.name() for symbol in symbols for s in cs.symvar(symbol))
    return f"{function}({', '.join(blocks)})"


def named_after(function: str, observed: cs.MX | ArrayLike, points: Points | cs.MX) -> str:
    """The same for observations; numbers have no name, so the blocks behind the points serve."""
    if isinstance(observed, cs.MX):
        return named(function, observed)
    if isinstance(points, Points):
        return f"{function}({', '.join(block.name for block in points.source.blocks)})"
    return named(function, points)


def same_shape(name: str, expression: cs.MX, observed: cs.MX) -> None:
    """Raise BadResidual unless the two can be subtracted entry by entry."""
    if expression.shape != observed.shape:
        (a, n), (b, m) = expression.shape, observed.shape
        raise BadResidual(
            f"residual {name!r} compares {n} points ({n}, {a}) with a block of shape ({m}, {b}); "
            "they must be the same"
        )
