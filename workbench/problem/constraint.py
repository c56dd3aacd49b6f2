"""Constraints, which a solution must satisfy at any cost: lower <= c(x) <= upper."""

from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Points, in_blocks
from workbench.blocks.block import Symbolic
from workbench.blocks.checks import reals, several
from workbench.errors import BadConstraint, BadResidual
from workbench.residuals.residual import blocks_read, check_listed, check_symbolic


@dataclass(frozen=True, eq=False)
class Constraint(Symbolic):
    """A named column that is kept between `lower` and `upper`, all three in `unit`.

    Limits are one number or one per row. Equal limits make an equation, and an infinite limit is
    none. Raises BadConstraint or NotNumbers.

    Attributes:
        name: the constraint's name, unique in a problem.
        expression: c(x), (k, 1) in `unit`.
        lower: the lower limit in `unit`, one or (k,); minus infinity for none.
        upper: the upper limit in `unit`, one or (k,); infinity for none.
        unit: what a row measures.
        points: the placeholders that the expression reads.
        tolerance: by how much, in `unit`, a feasible point may violate a limit.
    """

    name: str
    expression: cs.MX
    lower: ArrayLike = -np.inf
    upper: ArrayLike = np.inf
    unit: str = "1"
    points: tuple[Points, ...] = ()
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        try:
            check_symbolic(f"constraint {self.name!r}: the expression", self.expression)
            what = f"the points of constraint {self.name!r}"
            self.__dict__["points"] = several(what, self.points, Points, BadConstraint)
            check_listed(f"constraint {self.name!r}", self.expression, self.points)
        except BadResidual as error:
            raise BadConstraint(str(error)) from None
        if self.expression.shape[1] != 1 or not self.size:
            raise BadConstraint(
                f"constraint {self.name!r} must be a column (k, 1), not {self.expression.shape}; "
                "casadi.vec makes one"
            )
        lower, upper = self.limits
        if not (lower <= upper).all():  # also where one is NaN
            row = int(np.argmin(lower <= upper))
            raise BadConstraint(
                f"{self.label(row)} has the lower limit {lower[row]:g} and the upper limit "
                f"{upper[row]:g}; no number lies between"
            )
        if not (np.isfinite(lower) | np.isfinite(upper)).all():
            row = int(np.argmin(np.isfinite(lower) | np.isfinite(upper)))
            raise BadConstraint(f"{self.label(row)} has no finite limit; give one, or drop it")
        tolerance = reals(f"the tolerance of constraint {self.name!r}", self.tolerance)
        if tolerance.shape != () or not 0 < tolerance < np.inf:
            raise BadConstraint(
                f"constraint {self.name!r} needs a finite tolerance above zero in {self.unit}, "
                f"not {self.tolerance}"
            )

    @property
    def size(self) -> int:
        """k, the number of rows."""
        return int(self.expression.shape[0])

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper, (k,) each."""
        return self._limit("lower", self.lower), self._limit("upper", self.upper)

    @property
    def reads(self) -> tuple[str, ...]:
        """Names of the blocks that it depends on, directly or through its points."""
        return blocks_read(self.expression, self.points)

    def graph(self) -> cs.MX:
        """The expression in the symbols of blocks alone, (k, 1); see `Residual.graph`."""
        return in_blocks(self.expression, self.points)

    def label(self, row: int) -> str:
        """The name of one row."""
        return self.name if self.size == 1 else f"{self.name}[{row}]"

    def _limit(self, side: str, value: ArrayLike) -> Array:
        limit = reals(f"the {side} limit of constraint {self.name!r}", value)
        if limit.shape not in ((), (self.size,)):
            raise BadConstraint(
                f"constraint {self.name!r} has {self.size} rows; give one {side} limit or "
                f"{self.size} of them, not an array of shape {limit.shape}"
            )
        return np.array(np.broadcast_to(limit, (self.size,)))
