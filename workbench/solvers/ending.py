"""How a run ended, judged by the problem at the best point.

A run has converged if the largest cosine between a column of the Jacobian and the residual, in the
rows that its unknown can change and after projection on bounds and linearized constraints, is at
most `gradient_tolerance` (`problem/optimality.py`); a cosine that rounding explains counts as zero.
An end at which unknowns no longer change the residual, although they did on the way, is INSENSITIVE
(`sensitivity`). At a stationary point a direction along which the cost falls makes it a SADDLE, and
unknowns that grow without slowing down make it NO_FINITE_MINIMUM; both are said only if
evaluations show that the cost falls.
"""

from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Layout
from workbench.errors import some_of
from workbench.problem import Linearization
from workbench.problem.optimality import hidden
from workbench.problem.rounding import half_squared
from workbench.solvers.blindness import before_blind
from workbench.solvers.ended import NAMED, Ended, Ending
from workbench.solvers.flatness import flat_in_words
from workbench.solvers.limits import Stop
from workbench.solvers.no_minimum import LOOSE, unless_no_minimum
from workbench.solvers.sensitivity import lost
from workbench.solvers.solution import Status
from workbench.solvers.wrapping import rewrapped

BOUGHT = 1e-5  # of the cost: what violations within the tolerances of constraints may gain


def ending(run: Ended, stop: Stop) -> Ending:
    """Choose the best point of a run, and judge it by the problem, whatever the solver reports."""
    status, message, best = stop.status, stop.message, run.best
    if not np.isfinite(best.cost):
        return Ending(status, message)
    try:
        cheapest = best.x
        here = _judged(run, cheapest)
        optimality = best.decide(run.rounding_noise.optimality(cheapest, here))
        if best.x is not cheapest:
            here = _judged(run, best.x)
        here, optimality = _wrapped(run, here, optimality)
        gone = _lost(run, here)
    except Exception as error:  # of the user's residual; the best point is still known
        return Ending(status, f"{message} (no gradient at the best point: {error})")
    free = run.problem.free
    never, read = run.sensitivity.never, run.problem.support.read
    labels, unread, unnoticed = (
        tuple(free.labels_of(np.flatnonzero(m))) for m in (gone, never & ~read, never & read)
    )
    found = Ending(status, message, optimality, (*labels, *unread, *unnoticed))
    converged = optimality <= run.limits.gradient_tolerance
    if best.violation > 1:
        if status in (Status.CONVERGED, Status.STALLED):
            return replace(found, status=Status.INFEASIBLE, message=_violation(run))
        return found
    if gone.any() and (converged or status in (Status.CONVERGED, Status.STALLED)):
        return before_blind(run, gone, found)
    found = unless_no_minimum(run, here, found, converged)
    if found.status in (Status.SADDLE, Status.NO_FINITE_MINIMUM):
        return found
    if converged:
        message = Status.CONVERGED.value
        if run.limits.gradient_tolerance >= LOOSE:
            message = (
                f"the gradient is below the tolerance of {run.limits.gradient_tolerance:g}, which "
                "is too large to tell a minimum from a saddle, or from a cost that falls for ever; "
                "neither was looked for"
            )
        if unread:
            message += f" (no residual reads {some_of(unread, NAMED)})"
        if unnoticed:
            names = some_of(unnoticed, NAMED)
            message += f" (no residual changes with {names} where its Jacobian was computed)"
        message += flat_in_words(run.problem, best.x, here)
        return replace(found, status=Status.CONVERGED, message=message)
    if status in (Status.CONVERGED, Status.STALLED):
        if status is Status.CONVERGED:
            status, message = Status.STALLED, Status.STALLED.value
        return replace(found, status=status, message=_hidden(run, here, free) or message)
    return found


def prefer_stationary(
    run: Ended, x: Array, cost: float, here: Linearization, optimality: float
) -> None:
    """Prefer this point (n,) to the best one of a run if it is more stationary and costs the same.

    Costs are the same up to rounding, 1/2 (tolerance |r|)^2, and what the tolerances of constraints
    allow.
    """
    there = run.problem.stacked_constraints
    noise = run.rounding_noise.recent(x, here).of_cost(here.residual)
    noise += run.limits.gradient_tolerance**2 * cost
    if there is None:
        run.best.settle(x, cost, 0.0, optimality, noise)
    elif here.constraints is not None:
        violation = there.violation(here.constraints.values)
        run.best.settle(x, cost, violation, optimality, BOUGHT * cost + noise)


def _judged(run: Ended, x: Array) -> Linearization:
    """Residual and Jacobian at x (n,), evaluated without limits because the run is over."""
    known = run.linearizations.at(x)
    return run.problem.linearize_at(x, run.fixed) if known is None else known


def _lost(run: Ended, here: Linearization) -> Mask:
    """Which unknowns (n,) are lost: the residual changed with them, but not at the best point."""
    x, rounding = run.best.x, run.rounding_noise.at(run.best.x, here)
    gone = run.sensitivity.gone(x, here, run.problem.support, rounding)
    if not gone.any():
        return gone
    start = _judged(run, run.x)
    judged = run.problem.for_judging()
    size = run.sensitivity.size(x)
    return lost(gone, x, size, start, here, rounding, lambda to: judged.residual(to, run.fixed))


def _wrapped(run: Ended, here: Linearization, optimality: float) -> tuple[Linearization, float]:
    """Turn the best point's rotation vectors to at most half a turn, where that is free.

    A turn is free if the cost, up to rounding, and the constraints stay as they are. Takes the
    linearization and the optimality at the best point, and returns both for the point after
    turning. That is the same body, but its Jacobian has other columns, with other cosines between
    them and the residual: where the tolerance is no longer met, one Gauss-Newton step is tried.
    """
    problem, best, fixed = run.problem, run.best, run.fixed
    there = problem.stacked_constraints
    at_most = best.cost + run.rounding_noise.of_cost(best.x, here)

    def is_free(x: Array) -> bool:
        kept = there is None or there.violation(there.values(x, fixed)) <= max(best.violation, 1.0)
        return kept and half_squared(problem.residual(x, fixed)) <= at_most

    turned = rewrapped(problem, best.x, is_free)
    if turned is best.x:
        return here, optimality
    at_turned = problem.linearize_at(turned, fixed)
    found, tolerance = (
        run.rounding_noise.optimality(turned, at_turned),
        run.limits.gradient_tolerance,
    )
    if found > tolerance >= optimality:
        nearer = np.clip(turned + at_turned.step(), problem.lower, problem.upper)
        if is_free(nearer):
            closer = problem.linearize_at(nearer, fixed)
            by_step = run.rounding_noise.optimality(nearer, closer)
            if by_step <= tolerance:
                turned, at_turned, found = nearer, closer, by_step
    if found > tolerance >= optimality:
        return here, optimality  # turning it costs that it has converged
    best.x, best.cost = turned, at_turned.cost
    return at_turned, found


def _violation(run: Ended) -> str:
    there = run.problem.stacked_constraints
    if there is None:
        return Status.INFEASIBLE.value
    worst = there.worst(there.values(run.best.x, run.fixed))
    return f"{worst}; {Status.INFEASIBLE.value}"


def _hidden(run: Ended, here: Linearization, free: Layout) -> str:
    """Which unknown rounding errors hide most at the best point, in words; empty if none."""
    left = hidden(run.best.x, here, run.problem.support, run.rounding_noise.at(run.best.x, here))
    if not left.any():
        return ""
    i = int(np.argmax(left))
    also = int(np.sum(left > 0)) - 1
    others = f", and {also} more unknowns are hidden as well" if also > 1 else ""
    others = ", and one more unknown is hidden as well" if also == 1 else others
    unit = "" if free.unit(i) == "1" else f" {free.unit(i)}"
    return (
        f"rounding hides what is left: the terms of the residual are so large that {free.label(i)} "
        f"is known only to about {left[i]:.1g}{unit}{others}; choose units or sigmas that make "
        "the terms smaller"
    )
