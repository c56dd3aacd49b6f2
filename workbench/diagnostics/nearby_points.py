"""Points near a point, with what residuals do not notice there: there a gauge is one as well.

A symmetry of a problem is undone wherever its unknowns are, and a coincidence only at one point:
two decays of the same rate, a board that stands exactly across the view. Unknowns move by a share
of their yardsticks. Active constraints and bounds hold at the new points too, and so does what
residuals say of one block in a problem that ties it to others: a quaternion keeps its length, and a
corner that a prior holds its place.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.diagnostics.active_set import ConstrainedJacobian, constrained_jacobian_at
from workbench.diagnostics.point import Point
from workbench.problem.storage import by_nonzeros

COUNT = 5  # points: in a space of g motions, chance leaves nothing of those undone at each point
NEAR = 0.1  # of a yardstick, how far they are away in each entry
CLOSER = 0.1  # of that, where nothing finite is found so far away
STEPS = 20  # of Newton's method back to what is held, at the most
REACHED = 1e-12  # of the length of what is held
MOST = 400  # unknowns, up to which other points are asked


def nearby_null_spaces(
    point: Point, pattern: csc_array, units: Array
) -> tuple[tuple[Array, Array], ...]:
    """Points x (n,) near a point, and a basis (n, d) of the null space at each, both in units.

    `pattern` (m, n) says which unknowns a residual reads. There are no points for a large problem,
    and where nothing finite is found.
    """
    if point.problem.free.size > MOST:
        return ()
    rows = _of_one_block(point, pattern)
    for share in (NEAR, NEAR * CLOSER):
        found = [*_at_random(point, rows, units, share)]
        if len(found) == COUNT:
            return tuple(found)
    return ()


def _of_one_block(point: Point, pattern: csc_array) -> Index:
    """The rows that read one block, which other rows read together with others."""
    free = point.problem.free
    part = [pattern[: point.problem.size, at] for at in free.slices.values()]
    if not part:
        return np.zeros(0, dtype=np.int64)
    reads = np.column_stack([np.diff(csr_array(one).indptr) > 0 for one in part])
    alone = reads.sum(axis=1) == 1
    shared = reads[reads.sum(axis=1) > 1].any(axis=0)
    return np.flatnonzero(alone & reads[:, shared].any(axis=1))


def _at_random(
    point: Point, rows: Index, units: Array, share: float
) -> Iterator[tuple[Array, Array]]:
    rng = np.random.default_rng(0)
    x, fixed = point.problem.split(point.values)
    for _ in range(COUNT):
        step = share * point.yardsticks.sizes * rng.standard_normal(x.size)
        y = _held(point, rows, x + np.where(point.active.bounded, 0.0, step), x, fixed)
        if not np.isfinite(y).all():
            continue
        there = constrained_jacobian_at(point.problem, point.problem.values(y, fixed), point.active)
        if there.here.finite and np.isfinite(there.rows).all():
            yield y / units, _null_in(there, units)


def _null_in(there: ConstrainedJacobian, units: Array) -> Array:
    """(n, d) a basis of the null space in units, of the dimension that it has without them."""
    measured = there.measured(units)
    if measured.rank == there.rank:
        return measured.null
    return np.asarray(np.linalg.qr(there.null / units[:, None])[0])


def _held(point: Point, rows: Index, y: Array, x: Array, fixed: Array) -> Array:
    """y (n,), moved so that active constraints and these rows have the values that they have at x.

    By Newton's method with the smallest steps, in yardsticks.
    """
    held, _ = _what_is_held(point, rows, x, fixed)
    sizes = point.yardsticks.sizes
    for _ in range(STEPS if held.size else 0):
        there, A = _what_is_held(point, rows, y, fixed)
        missed = there - held
        if not np.isfinite(missed).all() or not np.isfinite(A).all():
            return np.full(y.shape, np.nan)
        if np.linalg.norm(missed) <= REACHED * (1 + np.linalg.norm(held)):
            break
        y = y - sizes * np.linalg.lstsq(A * sizes, missed)[0]
    return y


def _what_is_held(point: Point, rows: Index, x: Array, fixed: Array) -> tuple[Array, Array]:
    """The values (k,) of active constraints and of these rows, and their Jacobian (k, n)."""
    problem, active = point.problem, point.active.active
    values, A = np.zeros(0), np.zeros((0, x.size))
    if rows.size:
        here = problem.linearize(problem.values(x, fixed)).rows(rows)
        J = here.jacobian
        values, A = here.residual, J if isinstance(J, np.ndarray) else by_nonzeros(J).toarray()
    if problem.stacked_constraints is None or not active.any():
        return values, A
    held = problem.stacked_constraints.linearize(x, fixed)
    return np.append(values, held.values[active]), np.vstack([A, held.rows(active)])
