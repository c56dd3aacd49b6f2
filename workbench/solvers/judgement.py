"""How a run ended, judged by the problem at the best point, whatever a solver reports.

A run has converged if the largest cosine between a column of the Jacobian and the residual, in the
rows that its unknown can change and after projection on bounds and linearized constraints, is at
most `gradient_tolerance` (`problem/optimality.py`); a cosine that rounding explains counts as zero.
So has one that stalled where slope and curvature along the steepest descent say that the cost can
hardly fall (`_is_level`). A direction along which the cost falls from there makes the end a SADDLE.
Unknowns with which the residual does not change there make it INSENSITIVE, and unknowns that grow
without slowing down NO_FINITE_MINIMUM. All three are said only if evaluations show it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.blocks.layout import in_units
from workbench.errors import TooLarge, some_of
from workbench.geometry.rotation import wrapped_to_pi
from workbench.problem import Linearization, Problem
from workbench.problem.optimality import decrease, half_squared
from workbench.problem.steps import EPS
from workbench.solvers.limits import Stop
from workbench.solvers.no_minimum import (
    EndPoint,
    Saddle,
    diverging,
    most_gradients,
    random_vector,
    saddle,
)
from workbench.solvers.solution import Evaluations, Status

if TYPE_CHECKING:
    from workbench.solvers.run import Run

GAIN_BY_VIOLATION = 1e-5  # of the cost: what violations within their tolerances may gain
# a gradient tolerance from which on an end is not judged, because it is only near a minimum
LOOSE_TOLERANCE = 1e-3
# what evaluations far away end in, those of the user's residual included, and linear algebra there
SHOWS_NOTHING = (Stop, TooLarge, MemoryError, np.linalg.LinAlgError)
MAY_DIVERGE = (
    Status.CONVERGED,
    Status.STALLED,
    Status.MAX_ITERATIONS,
    Status.MAX_EVALUATIONS,
    Status.NO_FINITE_MINIMUM,
)
MAY_BE_INSENSITIVE = (Status.CONVERGED, Status.STALLED, Status.NO_FINITE_MINIMUM)
MOST_NAMED = 6  # unknowns in a message; there may be thousands
SMALLEST_NUDGE, LARGEST_NUDGE = 1e-3, 0.1  # of the size of an unknown, or of 1
MOST_NUDGED = 20  # unknowns at most that are tried one by one
CURVATURE_STEP = 1e-3  # of the size of an unknown: how far away the second gradient is taken
HARMLESS_FALL = 1e-6  # of the cost, which is 1/2 for one sigma: a fall by less changes no answer
WEAK_EFFECT = 1e-3  # of the residual: changed by less, an unknown is perhaps insensitive
HALF_A_TURN = np.pi * (1 + 1e-6)  # exactly there, two vectors are as short as each other
RANK_UP_TO = 300  # unknowns: of more, singular values take too long
MAYBE_NULL = 1e-6  # of the largest singular value: J'J cannot tell a smaller one from zero


@dataclass(frozen=True)
class Ending:
    """How a run ended; see the fields of the same names of `Solution`."""

    status: Status
    message: str
    optimality: float = np.nan
    insensitive: tuple[str, ...] = ()
    diverging: tuple[str, ...] = ()
    lower: Values | None = None
    judging: Evaluations = field(default_factory=Evaluations)


def ending(run: "Run", stop: Stop) -> Ending:
    """Choose the best point of a run, and judge it by the problem, whatever the solver reports.

    What cannot be evaluated shows nothing. After Ctrl-C nothing is looked for, and neither is it
    with a gradient tolerance of `LOOSE_TOLERANCE`, as in a stage whose end is only a start.
    """
    status, message, best = stop.status, stop.message, run.best
    if not np.isfinite(best.cost):
        return Ending(status, message)
    try:
        here, optimality = _at_best(run)
        end = end_point(run, here)
        silent = np.maximum(run.longest_columns, here.column_norms) == 0
    except Exception as error:  # of the user's residual; the best point is still known
        return Ending(status, f"{message} (no gradient at the best point: {error})")
    free, read = run.problem.free, run.problem.support.read
    unread, unnoticed = (free.labels_of(np.flatnonzero(silent & m)) for m in (~read, read))
    result = Ending(status, message, optimality, (*unread, *unnoticed))
    constraints = run.problem.stacked_constraints
    if constraints is not None and best.violation > 1:
        if status not in (Status.CONVERGED, Status.STALLED):
            return result
        worst = constraints.worst(constraints.values(best.x, run.fixed))
        message = f"{worst}; {Status.INFEASIBLE.value}"
        return replace(result, status=Status.INFEASIBLE, message=message)
    converged, is_level, other = optimality <= run.limits.gradient_tolerance, False, None
    try:
        is_level = not converged and status is Status.STALLED and _is_level(end)
        converged = converged or is_level
        other = _no_minimum(run, end, silent, converged, result)
    except SHOWS_NOTHING:
        pass
    if other is not None:
        result = other
    elif converged:
        message = _converged(run, here, tuple(unread), tuple(unnoticed))
        if is_level:
            message += f" (the cosine is {optimality:.2g}, but only of columns that are too short)"
        result = replace(result, status=Status.CONVERGED, message=message)
    elif status in (Status.CONVERGED, Status.NO_FINITE_MINIMUM):  # which the problem denies
        result = replace(result, status=Status.STALLED, message=Status.STALLED.value)
    return replace(result, judging=Evaluations(**end.counts))


def _at_best(run: "Run") -> tuple[Linearization, float]:
    """The linearization and the optimality at the best point of a run, which is chosen here."""

    def linearized(x: Array) -> Linearization:  # without limits, because the run is over
        return run.linearizations.at(x) or run.problem.linearize_at(x, run.fixed)

    best, cheapest = run.best, run.best.x
    here = linearized(cheapest)
    optimality = best.decide(run.rounding_noise.optimality(cheapest, here))
    if best.x is not cheapest:
        here = linearized(best.x)
    return _wrapped(run, here, optimality)


def _no_minimum(
    run: "Run", end: EndPoint, silent: Mask, converged: bool, result: Ending
) -> Ending | None:
    """The end as a saddle, without a finite minimum, or insensitive, if evaluations show that.

    `silent` (n,) are the unknowns whose columns were zero wherever the Jacobian was computed.
    """
    if run.limits.gradient_tolerance >= LOOSE_TOLERANCE:
        return None
    end.check()
    if converged:
        evaluations = sum(run.meter.counts.values()) + run.one_pass.saved
        beside = saddle(end, most_gradients(end.x.size, evaluations))
        if beside is not None:
            return _at_saddle(end, beside, result)
    if converged or result.status in MAY_DIVERGE:
        running = running_off(run, end, converged)
        if running.any():
            return _without_minimum(end, running, result)
    if converged or result.status in MAY_BE_INSENSITIVE:
        weak = insensitive(end, silent)
        if weak.any():
            labels = end.problem.free.labels_of(np.flatnonzero(weak))
            named = some_of(labels, MOST_NAMED)
            message = Status.INSENSITIVE.value.replace("some unknowns", named, 1)
            every = tuple(dict.fromkeys((*labels, *result.insensitive)))
            return replace(result, status=Status.INSENSITIVE, message=message, insensitive=every)
    return None


def end_point(run: "Run", here: Linearization) -> EndPoint:
    """The best point of a run, linearized `here`, as it is judged."""

    def check() -> None:
        if run.interrupted:
            raise Stop(Status.STOPPED)

    x, tolerance = run.best.x, run.limits.gradient_tolerance
    rounding, judged = run.rounding_noise.at(x, here), run.problem.for_judging()
    return EndPoint(judged, run.fixed, x, here, rounding, run.x, tolerance, check)


def _is_level(end: EndPoint) -> bool:
    """Whether the cost at a stalled end could fall by no more than the tolerance, and by no sigma.

    The fall is estimated by slope and curvature along the steepest descent, as (g'd)^2 / (2 d'Hd).
    """
    here, size = end.here, float(np.linalg.norm(end.here.residual))
    if here.constraints is not None:
        return False
    D = np.maximum(here.column_norms, size / end.size)
    d = np.clip(-here.gradient / D**2, end.problem.lower - end.x, end.problem.upper - end.x)
    if not d.any():
        return True
    d *= CURVATURE_STEP / float(np.max(np.abs(d) / end.size))
    curvature = float((end.gradient(end.x + d) - here.gradient) @ d)
    slope = float(here.gradient @ d)
    return curvature > 0 and slope * slope <= 2 * curvature * min(end.worth, HARMLESS_FALL)


def running_off(run: "Run", end: EndPoint, converged: bool = False) -> Mask:
    """The unknowns (n,) that grow without limit while the cost falls; see `diverging`."""
    noticed = run.longest_columns * end.size > run.problem.support.norms(end.rounding.rows)
    return diverging(end, run.trace, noticed, converged)


def insensitive(end: EndPoint, silent: Mask) -> Mask:
    """The unknowns (n,) with which the residual hardly changes at an end.

    Candidates are those whose columns are so short that moving x_i by its size, or by 1, changes
    the rows that it can change by at most a thousandth or their rounding errors, while these rows
    are not zero themselves. A candidate is insensitive if the cost does not rise on both of its
    sides at any distance up to a tenth of that. Only the twenty weakest candidates are tried one by
    one; if nothing changes as all candidates move together, all of them are insensitive.

    Unknowns that are `silent` (n,), because their columns were zero wherever the Jacobian was
    computed, count only if the residual changes with them elsewhere, or with no unknown at all
    here: a finger that no keypoint shows does not spoil the fit of an arm.
    """
    support, here = end.problem.support, end.here
    error, rows = support.norms(end.rounding.rows), support.norms(here.residual)
    weak = here.column_norms * end.size <= error
    weak |= here.column_norms * np.maximum(end.size, 1.0) <= WEAK_EFFECT * rows
    weak &= support.read & (rows > error) & (end.problem.lower < end.problem.upper)
    unseen = weak & silent
    if unseen.any() and not (weak == support.read).all() and _silent_elsewhere(end, unseen):
        weak &= ~silent
    if weak.any() and all(not change for change in _changes(end, weak, 1.0)):
        return np.asarray(weak)
    weakest = np.argsort(np.where(weak, here.column_norms, np.inf))[: min(weak.sum(), MOST_NUDGED)]
    weak[:] = False
    for i in weakest:
        alone = np.arange(len(weak)) == i
        both_sides = zip(_changes(end, alone, -1.0), _changes(end, alone, 1.0), strict=True)
        weak[i] = not any(below < 0 and above < 0 for below, above in both_sides)
    return np.asarray(weak)


def _silent_elsewhere(end: EndPoint, silent: Mask) -> bool:
    """Whether the residual stays as it is if `silent` unknowns (n,) have quite different values."""
    elsewhere = (np.zeros_like(end.x), end.x / 10, random_vector(len(end.x)))
    residuals = (end.residual(np.where(silent, values, end.x)) for values in elsewhere)
    return all((np.abs(r - end.here.residual) <= end.rounding.rows).all() for r in residuals)


def _changes(end: EndPoint, moved: Mask, side: float) -> Iterator[float]:
    """By how much the cost falls as the unknowns `moved` (n,) go to a side, from far to near.

    Negative if it rises, or a bound is in the way; 0 where rounding may be all of the change.
    """
    share, size = LARGEST_NUDGE, float(end.size[moved].max())
    while share * max(size, 1.0) >= SMALLEST_NUDGE * size:
        to = end.x + side * share * np.where(moved, np.maximum(end.size, 1.0), 0.0)
        if (to < end.problem.lower).any() or (to > end.problem.upper).any():
            yield -np.inf
        else:
            r = end.residual(to)
            fall = decrease(end.here.residual, r)
            noise = end.rounding.of_decrease(end.here.residual, r != end.here.residual)
            yield 0.0 if abs(fall) <= noise else fall
        share /= 10


def _at_saddle(end: EndPoint, beside: Saddle, result: Ending) -> Ending:
    """The direction in the words of a diagnosis, and where to start instead."""
    free, cost = end.problem.free, end.here.cost
    least = np.linalg.norm(end.here.residual) / end.size  # of columns that vanish at the saddle
    along = in_units(beside.to - end.x, free, np.maximum(end.here.column_norms, least), MOST_NAMED)
    message = (
        f"the gradient vanishes, but this is no minimum: the cost falls along {along}, from "
        f"{cost:.6g} to {cost - beside.fall:.6g} at the point that `lower` of the solution holds; "
        "start from there"
    )
    lower = free.unpack(beside.to, end.problem.fixed.unpack(end.fixed) if free.parts else None)
    return replace(result, status=Status.SADDLE, message=message, lower=lower)


def _without_minimum(end: EndPoint, running: Mask, result: Ending) -> Ending:
    """Which unknowns grow without limit, and how far they have come."""
    places = np.flatnonzero(running)
    labels = end.problem.free.labels_of(places)
    values = [f"{name} = {end.x[i]:.3g}" for name, i in zip(labels, places, strict=True)]
    status, named = Status.NO_FINITE_MINIMUM, f"unknowns ({some_of(values, MOST_NAMED)})"
    message = status.value.replace("some unknowns", named, 1)
    return replace(result, status=status, message=message, diverging=tuple(labels))


def _converged(
    run: "Run", here: Linearization, unread: tuple[str, ...], unnoticed: tuple[str, ...]
) -> str:
    """What is to be said of an end that has converged."""
    message = Status.CONVERGED.value
    if run.limits.gradient_tolerance >= LOOSE_TOLERANCE:
        message = (
            f"the gradient is below the tolerance of {run.limits.gradient_tolerance:g}, which "
            "is too large to tell a minimum from a saddle, or from a cost that falls for ever; "
            "neither was looked for"
        )
    if unread:
        message += f" (no residual reads {some_of(unread, MOST_NAMED)})"
    if unnoticed:
        names = some_of(unnoticed, MOST_NAMED)
        message += f" (no residual changes with {names} where its Jacobian was computed)"
    return message + flat_in_words(run.problem, run.best.x, here)


def _wrapped(run: "Run", here: Linearization, optimality: float) -> tuple[Linearization, float]:
    """Turn the best point's rotation vectors to at most half a turn, where that is free.

    Free means that the cost and the constraints stay as they are, and that what has converged stays
    so. Returns the linearization and the optimality at the best point afterwards.
    """
    problem, best, fixed = run.problem, run.best, run.fixed
    constraints = problem.stacked_constraints
    highest = best.cost + run.rounding_noise.of_cost(best.x, here)

    def is_free(x: Array) -> bool:
        if constraints is not None:
            violation = constraints.violation(constraints.values(x, fixed))
            if violation > max(best.violation, 1.0):
                return False
        return half_squared(problem.residual(x, fixed)) <= highest

    wrapped = rewrapped(problem, best.x, is_free)
    if wrapped is best.x:
        return here, optimality
    at_wrapped = problem.linearize_at(wrapped, fixed)
    after = run.rounding_noise.optimality(wrapped, at_wrapped)
    if after > run.limits.gradient_tolerance >= optimality:
        return here, optimality  # it would no longer have converged
    best.x, best.cost = wrapped, at_wrapped.cost
    return at_wrapped, after


def rewrapped(problem: Problem, x: Array, is_free: Callable[[Array], bool]) -> Array:
    """The point x (n,) with rotation vectors of at most half a turn, where that `is_free`.

    All joints that are turned by more than pi are changed at once. If that is not free, they are
    changed one after the other, where each change is free. No change leaves the bounds. Without any
    change the result is the array x itself.
    """
    shorter = _shorter_vectors(problem, x)
    together = x.copy()
    for joint, vector in shorter:
        together[joint] = vector
    if len(shorter) > 1 and is_free(together):
        return together
    for joint, vector in shorter:
        changed = x.copy()
        changed[joint] = vector
        if is_free(changed):
            x = changed
    return x


def _shorter_vectors(problem: Problem, x: Array) -> list[tuple[slice, Array]]:
    """The places of joints that are turned by more than pi, and their shorter vectors."""
    starts = np.array([joint.start for joint in problem.rotations], dtype=np.int64)
    if not starts.size:
        return []
    angles = np.linalg.norm(x[starts[:, None] + np.arange(3)], axis=1)
    shorter = []
    for start in starts[angles > HALF_A_TURN]:
        joint = slice(int(start), int(start) + 3)
        vector = wrapped_to_pi(x[joint])
        if (problem.lower[joint] <= vector).all() and (vector <= problem.upper[joint]).all():
            shorter.append((joint, vector))
    return shorter


def flat_in_words(problem: Problem, x: Array, here: Linearization) -> str:
    """How many directions change no residual at x (n,); empty if none does.

    Zero columns, unknowns on bounds, and problems with constraints are left out. Singular values
    are computed only if the eigenvalues of J'J say that one may be zero.
    """
    inside = np.flatnonzero((here.column_norms > 0) & (x > problem.lower) & (x < problem.upper))
    n = inside.size
    if here.constraints is not None or here.estimated or not 0 < n <= RANK_UP_TO:
        return ""
    lengths = here.column_norms[inside]
    normal = np.asarray(here.normal)[np.ix_(inside, inside)] / np.outer(lengths, lengths)
    if np.linalg.eigvalsh(normal)[0] > MAYBE_NULL**2 * n + 100 * n * EPS:
        return ""
    null = n - here.columns(inside).scaled(1 / lengths).rank
    if null == 0:
        return ""
    directions = "1 direction changes" if null == 1 else f"{null} directions change"
    return f" ({directions} no residual here, so that other values fit as well; see a diagnosis)"
