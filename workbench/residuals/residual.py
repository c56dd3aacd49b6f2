"""The one shape that every error term has."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.residuals.kernels import Kernel, quadratic


@dataclass(frozen=True, eq=False)
class Residual:
    """A named column that should be near zero, ordinary at `sigma`, both in `unit`.

    Problems see it whitened: half the sum of squares is then dimensionless, and minus a log
    likelihood up to a constant. `points` are the placeholders that the expression reads;
    `labels` name its rows. Raises BadResidual if it is no column or has no positive sigma.
    """

    name: str
    expression: cs.MX  # (m, 1) in `unit`
    sigma: float | NDArray[np.float64]  # one for all rows, or (m,), in `unit`
    unit: str = "1"
    kernel: Kernel = quadratic
    points: tuple[Points, ...] = ()
    labels: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if self.expression.shape[1] != 1:
            raise BadResidual(
                f"residual {self.name!r} must be a column (m, 1), not {self.expression.shape}; "
                "casadi.vec makes one"
            )
        sigma = np.asarray(self.sigma, dtype=float)
        if sigma.shape not in ((), (self.size,)) or not (sigma > 0).all():
            raise BadResidual(
                f"residual {self.name!r} needs a sigma above zero in {self.unit}, one or "
                f"{self.size} of them, not {self.sigma}"
            )
        if self.labels is not None and len(self.labels) != self.size:
            raise BadResidual(
                f"residual {self.name!r} has {self.size} rows but {len(self.labels)} labels"
            )

    @property
    def size(self) -> int:
        """m."""
        return int(self.expression.shape[0])

    @property
    def whitened(self) -> cs.MX:
        """The residual in sigmas, shrunk by its kernel: (m, 1)."""
        r = self.expression / cs.DM(self.sigma)
        return r if self.kernel is quadratic else self.kernel(r**2) * r

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that it depends on, directly or through its points."""
        placeholders = {p.symbol.__hash__() for p in self.points}
        own = (s for s in cs.symvar(self.expression) if s.__hash__() not in placeholders)
        names = [s.name() for s in own]
        names += [b.name for p in self.points for b in p.source.blocks]
        return tuple(dict.fromkeys(names))

    def label(self, row: int) -> str:
        """The name of one row: `keypoints(camera 1/observed)[left_wrist, u]`."""
        return f"{self.name}[{self.labels[row] if self.labels else row}]"


def expressed(points: Points | cs.MX) -> tuple[cs.MX, tuple[Points, ...]]:
    """Points or a bare matrix (3, N), as an expression and what it reads."""
    return (points.symbol, (points,)) if isinstance(points, Points) else (points, ())


def row_labels(points: Points | cs.MX, axes: Sequence[str]) -> tuple[str, ...] | None:
    """`left_wrist, x` for each coordinate of points that have names."""
    names = points.labels if isinstance(points, Points) else None
    return None if names is None else tuple(f"{n}, {a}" for n in names for a in axes)


def named(function: str, *symbols: cs.MX) -> str:
    """`function(block, block)`; pieces and expressions go by the blocks that they read."""
    blocks = dict.fromkeys(s.name() for symbol in symbols for s in cs.symvar(symbol))
    return f"{function}({', '.join(blocks)})"


def same_shape(name: str, expression: cs.MX, observed: cs.MX) -> None:
    """Raise BadResidual unless the two can be subtracted entry by entry."""
    if expression.shape != observed.shape:
        (a, n), (b, m) = expression.shape, observed.shape
        raise BadResidual(
            f"residual {name!r} compares {n} points ({n}, {a}) with a block of shape ({m}, {b}); "
            "they must be the same"
        )
