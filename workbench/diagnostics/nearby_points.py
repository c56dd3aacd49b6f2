"""Points near a point, with what residuals do not notice there: there a gauge is one as well.

A symmetry of a problem is undone wherever its unknowns are, and a coincidence only at one point:
two decays of the same rate, a board that stands exactly across the view. Unknowns move by a share
of their yardsticks; active constraints and bounds hold at the new points too.
"""

from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.active_set import ConstrainedJacobian, constrained_jacobian_at
from workbench.diagnostics.point import Point

COUNT = 5  # points: in a space of g motions, chance leaves nothing of those undone at each point
NEAR = 0.1  # of a yardstick, how far they are away in each entry
CLOSER = 0.1  # of that, where nothing finite is found so far away
STEPS = 4  # of Newton's method back to what constraints hold
MOST = 400  # unknowns, up to which other points are asked


def nearby_null_spaces(point: Point, units: Array) -> tuple[tuple[Array, Array], ...]:
    """Points x (n,) near a point, and a basis (n, d) of the null space at each, both in units.

    There are none for a large problem, and where nothing finite is found.
    """
    if point.problem.free.size > MOST or point.constrained.by_elimination is not None:
        return ()
    for share in (NEAR, NEAR * CLOSER):
        found = [*_at_random(point, units, share)]
        if len(found) == COUNT:
            return tuple(found)
    return ()


def _at_random(point: Point, units: Array, share: float) -> Iterator[tuple[Array, Array]]:
    rng = np.random.default_rng(0)
    x, fixed = point.problem.split(point.values)
    for _ in range(COUNT):
        step = share * point.yardsticks.sizes * rng.standard_normal(x.size)
        y = _held(point, x + np.where(point.active.bounded, 0.0, step), x, fixed)
        there = constrained_jacobian_at(point.problem, point.problem.values(y, fixed), point.active)
        if there.here.finite and np.isfinite(there.rows).all():
            yield y / units, _null_in(there, units)


def _null_in(there: ConstrainedJacobian, units: Array) -> Array:
    """(n, d) a basis of the null space in units, of the dimension that it has without them."""
    measured = there.measured(units)
    if measured.rank == there.rank:
        return measured.null
    return np.asarray(np.linalg.qr(there.null / units[:, None])[0])


def _held(point: Point, y: Array, x: Array, fixed: Array) -> Array:
    """y (n,), moved so that active constraints have the values that they have at x."""
    constraints, active = point.problem.stacked_constraints, point.active.active
    if constraints is None or not active.any():
        return y
    held = constraints.values(x, fixed)[active]
    for _ in range(STEPS):
        there = constraints.linearize(y, fixed)
        A, missed = there.rows(active), there.values[active] - held
        y = y - np.linalg.lstsq(A, missed)[0]
    return y
