"""Whether a run has no finite minimum: the cost falls for ever as some unknowns grow.

exp(-x) has no least square, nor has any model that fits the better, the larger one of its numbers.
A run shows this if some unknowns grew to its last iterates, without slowing down as they do near a
minimum. Then they are taken further and further, the others follow by Gauss-Newton steps, and there
is a valley if the cost never rises.
"""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array, Mask
from workbench.problem.covariance import inverse_times
from workbench.problem.rounding import fall, half_squared
from workbench.problem.steps import SLIGHT
from workbench.solvers.end_point import EndPoint
from workbench.solvers.iterate import Iterate

ITERATES = 5  # at least: fewer show no tendency
GROWN = 0.02  # of an unknown's size, in the last quarter of a run
SLOWED = 0.3  # of the growth in the quarter before: at a minimum it is much less
BEYOND = 3.0  # times its value at the start, at least: how large such an unknown has become
NEAR = (0.01, 0.1, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0, 8.0, 15.0, 30.0)  # times the way so far: each
FARTHER = (*NEAR, 100.0, 1e4, 1e6, 1e8)  # of these is tried; at a minimum between, the cost rises
SURELY = 8  # of these, at least, must be tried; beyond, the residual may be infinite
FOLLOWED = 5  # Gauss-Newton steps of the other unknowns at each of them
IMPERFECT = 1e-6  # of the cost: what these steps may leave above the least
HELD = 1e20  # times the squared length of a column: added to it, holds its unknown
SHORTER = (1.0, 0.25, 0.06)  # parts of such a step that are tried


def valley(
    end: EndPoint, start: Array, trace: Sequence[Iterate], noticed: Mask, converged: bool
) -> Mask | None:
    """The unknowns (n,) that run off while the cost falls; None if none do, or after few iterates.

    `start` (n,) is the first point of the trace, and `noticed` (n,) are the unknowns that changed
    the residual by more than rounding. If the run has `converged`, its last step must
    also be about as long as those before.
    """
    if len(trace) < ITERATES or not np.isfinite(end.here.cost):
        return None
    last, pack = len(trace) - 1, end.problem.free.pack
    middle, late, final = (trace[k] for k in (last // 2, (3 * last) // 4, last))
    quarters, there = (pack(middle.values), pack(late.values)), pack(final.values)
    noise = end.noise
    running = _running(end, start, *quarters, end.x)
    if final.cost <= end.here.cost + noise:  # the best point may be one of several at its cost
        running |= _running(end, start, *quarters, there)
    running &= noticed & (end.x != start)
    if converged and running.any():
        step = np.abs(there - pack(trace[last - 1].values))
        way = np.abs(there - quarters[1])
        running &= step > SLOWED * way / (last - (3 * last) // 4)
    if not running.any() or not middle.cost > end.here.cost + noise:
        return None
    way, tried = np.where(running, end.x - start, 0.0), 0
    at = _followed(end, end.x, running, noise)
    before = end.residual(at)
    for times in FARTHER:
        at = _followed(end, np.where(running, end.x + times * way, at), running, noise)
        r = end.residual(at)
        if not np.isfinite(r).all():
            break
        left = IMPERFECT * half_squared(before) + end.rounding.of_fall(before, r != before)
        if fall(before, r) < -left:
            return None
        before, tried = r, tried + 1
    return running if tried >= SURELY else None


def _running(end: EndPoint, start: Array, middle: Array, late: Array, final: Array) -> Mask:
    """The unknowns (n,) that grew as fast in the last quarter of the run as before."""
    before, now = late - middle, final - late
    size = np.abs(final)
    grew = (size >= BEYOND * np.abs(start)) & (np.abs(now) > GROWN * size)
    grew &= np.abs(now) > SLOWED * np.abs(before)
    grew &= (now * before > 0) & (now * final > 0)
    limit = np.where(now > 0, end.problem.upper, end.problem.lower)
    return np.asarray(grew & ~np.isfinite(limit))


def _followed(end: EndPoint, x: Array, running: Mask, noise: float) -> Array:
    """The point after the unknowns that do not run have followed, by Gauss-Newton steps."""
    for _ in range(0 if running.all() else FOLLOWED):
        cost, step = _step_of_others(end, x, running)
        to = None if step is None else _lower(end, x, step, cost - noise)
        if to is None:
            return x
        x = to
    return x


def _lower(end: EndPoint, x: Array, step: Array, cost: float) -> Array | None:
    """The first point along a step (n,) at which the cost is lower than this one, if there is."""
    for part in SHORTER:
        to = np.clip(x + part * step, end.problem.lower, end.problem.upper)
        if half_squared(end.residual(to)) < cost:
            return to
    return None


def _step_of_others(end: EndPoint, x: Array, running: Mask) -> tuple[float, Array | None]:
    """The cost at x, and the Gauss-Newton step (n,) of the unknowns that do not run.

    There is no step where the linearization is not finite. In a sequence no columns are copied,
    because the copy would take much more memory than the Jacobian. Instead, an unknown that runs
    is held: a number is added on its diagonal that is so large that its step is zero to rounding.
    The others are slightly damped if their columns are dependent.
    """
    here = end.linearize(x)
    cost = here.cost
    if not here.finite:
        return cost, None
    if not here.by_frames:
        rest, found = np.flatnonzero(~running), np.zeros(len(x))
        found[rest] = here.columns(rest).step()
        return cost, found
    gradient, normal = here.gradient, here.normal
    squares = np.where(here.column_norms > 0, here.column_norms, 1.0) ** 2
    del here  # and its Jacobian, before the normal equations are copied
    for damping in (0.0, SLIGHT):
        step = inverse_times(normal, -gradient, np.where(running, HELD, damping) * squares)
        if step is not None:
            return cost, np.where(running, 0.0, step)
    return cost, None
