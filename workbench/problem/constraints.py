"""Constraints, which a solution must satisfy at any cost, and all those of a problem."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Mask
from workbench.blocks import Layout, Points, in_blocks
from workbench.blocks.block import Symbolic
from workbench.blocks.checks import reals, several
from workbench.blocks.functions import Buffered
from workbench.blocks.points import distinct
from workbench.errors import BadConstraint, BadResidual
from workbench.problem.chain import Chain
from workbench.problem.graph import Graph, split
from workbench.problem.sparsity import Pattern
from workbench.problem.storage import (
    Stored,
    absolute,
    dense,
    entries,
    is_sparse,
    scaled_sparse,
)
from workbench.residuals import Residual
from workbench.residuals.residual import blocks_read, check_listed, check_symbolic

Part = TypeVar("Part", Residual, "Constraint")


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
        has_limit = np.isfinite(lower) | np.isfinite(upper)
        if not has_limit.all():
            row = int(np.argmin(has_limit))
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


def part_at(parts: Sequence[Part], row: int) -> tuple[Part, int]:
    """To which of some stacked parts a row belongs, and which of its rows it is.

    Raises IndexError.
    """
    left = row
    for part in parts:
        if 0 <= left < part.size:
            return part, left
        left -= part.size
    raise IndexError(f"row {row} of {row - left}")


@dataclass(frozen=True, eq=False)
class LinearizedConstraints:
    """The linear model c(x + p) ~ values + jacobian p, to be kept between lower and upper."""

    values: Array  # c(x) (k,), each in its unit
    jacobian: Stored  # (k, n), by the same rule as that of a residual (`storage.is_sparse`)
    lower: Array  # (k,) the lower limits
    upper: Array  # (k,) the upper limits
    tolerance: Array  # (k,) violations up to which a limit counts as met

    @property
    def finite(self) -> bool:
        """Whether all values and derivatives are finite."""
        return bool(np.isfinite(self.values).all() and np.isfinite(entries(self.jacobian)).all())

    @property
    def usable(self) -> Mask:
        """The rows (k,) whose derivatives are finite and not all zero."""
        sizes = np.asarray(absolute(self.jacobian).sum(axis=1))
        return np.asarray(np.isfinite(sizes) & (sizes > 0))

    def per(self, lengths: Array) -> Stored:
        """The Jacobian with each column divided by a length (n,), stored as it is."""
        if isinstance(self.jacobian, csc_array):
            return scaled_sparse(self.jacobian, 1 / lengths)
        return self.jacobian / lengths

    def rows(self, chosen: Mask) -> Array:
        """Some rows of the Jacobian as an array. Raises TooLarge where that does not fit."""
        if isinstance(self.jacobian, csc_array):
            return dense(csc_array(csr_array(self.jacobian)[np.flatnonzero(chosen)]))
        return self.jacobian[chosen]

    def along(self, directions: Array) -> Array:
        """The Jacobian times directions (n, d): by how much each value changes, (k, d)."""
        return np.asarray(self.jacobian @ directions)

    def magnitudes_along(self, directions: Array) -> Array:
        """The sums of the absolute terms of these products, (k, d), by which rounding is judged."""
        return np.asarray(absolute(self.jacobian) @ abs(directions))

    @property
    def allowed_changes(self) -> tuple[Array, Array]:
        """The smallest and the largest change (k,) of each value that meets its limits.

        Where a limit is violated, both have the sign of the change that is needed; a violation
        within the tolerance needs none.
        """
        down, up = self.lower - self.values, self.upper - self.values
        down = np.where(down > self.tolerance, down, np.minimum(down, 0))
        up = np.where(-up > self.tolerance, up, np.maximum(up, 0))
        return down, up


class ConstraintSet:
    """All constraints c(x, fixed) (k,), their Jacobian, and the Hessian of multipliers' c.

    Values and Jacobian come from the chain rule, the Hessian from the whole graph, each when it is
    first asked for.
    """

    def __init__(self, constraints: Sequence[Constraint], free: Layout, fixed: Layout) -> None:
        self.constraints, self._layouts = tuple(constraints), (free, fixed)
        self._points = distinct(p for c in self.constraints for p in c.points)
        limits = [c.limits for c in self.constraints]
        self.lower = np.concatenate([lower for lower, _ in limits])
        self.upper = np.concatenate([upper for _, upper in limits])
        sizes = [c.size for c in self.constraints]
        self.tolerance = np.repeat([c.tolerance for c in self.constraints], sizes)

    @property
    def size(self) -> int:
        """k, the number of rows."""
        return len(self.lower)

    @property
    def equal(self) -> Mask:
        """Which rows are equations, (k,)."""
        return np.asarray(self.lower == self.upper)

    def label(self, row: int) -> str:
        """The name of one row."""
        part, place = part_at(self.constraints, row)
        return part.label(place)

    @cached_property
    def function(self) -> cs.Function:
        """(x, fixed) -> c: the stacked constraints, (k, 1), each in its unit."""
        g = self._graph
        return cs.Function("constraints", [g.x, g.fixed], [g.residual], ["x", "fixed"], ["c"])

    def values(self, x: Array, fixed: Array) -> Array:
        """The constraints' values c(x), (k,), each in its unit."""
        return self._chain.residual(x, fixed)

    def linearize(self, x: Array, fixed: Array) -> LinearizedConstraints:
        """c and its Jacobian (k, n), dense or sparse."""
        return LinearizedConstraints(
            *self._chain.linearize(x, fixed), self.lower, self.upper, self.tolerance
        )

    @property
    def sparse(self) -> bool:
        """Whether the Jacobian is stored by its nonzeros."""
        return self._chain.sparse

    @property
    def pattern(self) -> csc_array:
        """Where the Jacobian can be nonzero, (k, n); points depend on all of their blocks."""
        return self._chain.pattern

    @cached_property
    def hessian_pattern(self) -> csc_array:
        """Where the Hessian of multipliers' c can be nonzero, (n, n), by the whole graph."""
        pattern = Pattern(self._curvature[1].sparsity())
        return pattern.matrix(np.ones(len(pattern.rows)))

    def hessian(self, x: Array, fixed: Array, multipliers: Array) -> Stored:
        """The Hessian of multipliers' c, (n, n), stored like a Jacobian of this size."""
        numbers = self._hessian(x, fixed, multipliers)[0]
        if len(numbers) == len(x) ** 2:
            return numbers.reshape(len(x), len(x))
        pattern = self.hessian_pattern
        return csc_array((numbers, pattern.indices, pattern.indptr), shape=pattern.shape)

    def violation(self, values: Array) -> float:
        """The largest violation of a limit, in tolerances; the point is feasible up to 1."""
        return float(np.max(self._violations(values))) if np.isfinite(values).all() else np.inf

    def worst(self, values: Array) -> str:
        """The most violated limit in words."""
        row = int(np.argmax(self._violations(values)))
        below = self.lower[row] - values[row] > values[row] - self.upper[row]
        side, limit = ("below", self.lower[row]) if below else ("above", self.upper[row])
        part, _ = part_at(self.constraints, row)
        unit = "" if part.unit == "1" else f" {part.unit}"
        return f"{self.label(row)} is {values[row]:.6g}{unit}, {side} its limit {limit:.6g}"

    def _violations(self, values: Array) -> Array:
        """By how many tolerances each value (k,) is outside of its limits; negative inside."""
        return np.asarray(
            np.maximum(self.lower - values, values - self.upper) / self.tolerance, dtype=float
        )

    @property
    def _stacked(self) -> cs.MX:
        return cs.vertcat(*[c.expression for c in self.constraints])

    @cached_property
    def _graph(self) -> Graph:
        return Graph.of(in_blocks(self._stacked, self._points), *self._layouts)

    @cached_property
    def _chain(self) -> Chain:
        return Chain(*split(self._stacked, self._points, *self._layouts), *self._layouts)

    @cached_property
    def _curvature(self) -> tuple[cs.MX, cs.MX]:
        """The multipliers, and the Hessian of their product with the constraints."""
        y = cs.MX.sym("multipliers", self.size)
        return y, cs.hessian(cs.dot(y, self._graph.residual), self._graph.x)[0]

    @cached_property
    def _hessian(self) -> Buffered:
        g, (y, H) = self._graph, self._curvature
        n = H.shape[0]
        H = H if is_sparse(n, n, H.nnz()) else cs.densify(H)
        return Buffered(cs.Function("H", [g.x, g.fixed, y], [H]))
