"""What equations hold at a point, and which bounds are active there without being equations."""

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.point import Point
from workbench.diagnostics.row_spaces import tangent_space


def directions_left(point: Point, yardsticks: Array) -> Array | None:
    """An orthonormal basis (n, p), in yardsticks, of what equations leave free; None without any.

    Equations are those among the constraints, and equal bounds of an unknown.
    """
    rows = point.active.rows[_equations(point)]
    return tangent_space(rows * yardsticks) if len(rows) else None


def active_inequalities(point: Point) -> tuple[str, ...]:
    """The bounds and inequality constraints that are active, such as `x[0] >= 0`."""
    equations = _equations(point)
    return tuple(
        name for name, holds in zip(point.active.names, equations, strict=True) if not holds
    )


def combinations_left(gradients: Array, left: Array) -> Array:
    """Of quantities with gradients (n, q), the combinations that equations do not determine.

    They are orthonormal combinations, so that sums of variances and the largest one stay the same.
    """
    along = left.T @ gradients
    _, s, Vt = np.linalg.svd(along, full_matrices=False)
    return np.asarray(gradients @ Vt[s > NOTHING * np.linalg.norm(gradients)].T)


def _equations(point: Point) -> Array:
    """Which active rows are equations, (k,)."""
    problem, active = point.problem, point.active
    there = problem.stacked_constraints
    of_constraints = np.zeros(0, dtype=bool) if there is None else there.equal[active.active]
    return np.concatenate([of_constraints, (problem.lower == problem.upper)[active.bounded]])


NOTHING = 1e-10  # of the gradients
