"""Whether the end of a run is no minimum: a saddle, or a point in a valley without end."""

from dataclasses import replace

import numpy as np

from workbench.arrays import Mask
from workbench.blocks.directions import in_units
from workbench.errors import some_of
from workbench.problem import Linearization
from workbench.solvers.end_point import EndPoint
from workbench.solvers.ended import NAMED, Ended, Ending
from workbench.solvers.iterate import Evaluations
from workbench.solvers.limits import Stop
from workbench.solvers.saddle import Saddle, most_gradients, saddle
from workbench.solvers.solution import Status
from workbench.solvers.valley import valley

LOOSE = 1e-3  # a gradient tolerance from which on an end is not judged: it is only near a minimum
MAY_BE_A_VALLEY = (
    Status.CONVERGED,
    Status.STALLED,
    Status.MAX_ITERATIONS,
    Status.MAX_EVALUATIONS,
)


def unless_no_minimum(run: Ended, here: Linearization, found: Ending, converged: bool) -> Ending:
    """The same ending with its evaluations, or SADDLE or VALLEY if the point is shown to be one.

    What cannot be evaluated shows nothing. After Ctrl-C nothing is looked for, and neither is it
    where the gradient tolerance is `LOOSE`, as in a stage whose end is only a start.
    """
    if run.limits.gradient_tolerance >= LOOSE:
        return found

    def check() -> None:
        if run.interrupted:
            raise Stop(Status.STOPPED)

    x, noise = run.best.x, run.rounding_noise.at(run.best.x, here)
    tolerance = run.limits.gradient_tolerance
    size = run.sensitivity.size(x)
    judged = run.problem.for_judging()
    end = EndPoint(judged, run.fixed, x, here, noise, size, tolerance, check)
    no_minimum: Saddle | Mask | None = None
    try:
        check()
        if converged:
            evaluations = sum(run.meter.counts.values()) + run.one_pass.saved
            no_minimum = saddle(end, most_gradients(x.size, evaluations))
        if no_minimum is None and (converged or found.status in MAY_BE_A_VALLEY):
            noticed = run.sensitivity.noticed(x, run.problem.support.norms(noise.rows))
            no_minimum = valley(end, run.x, run.trace, noticed, converged)
    except Exception:  # of the user's residual far away, or of a limit outside of the run
        no_minimum = None
    found = replace(found, judging=Evaluations(**end.counts))
    if isinstance(no_minimum, Saddle):
        return _at_saddle(end, no_minimum, found)
    return found if no_minimum is None else _in_valley(end, no_minimum, found)


def _at_saddle(end: EndPoint, there: Saddle, found: Ending) -> Ending:
    """The direction in the words of a diagnosis, and where to start instead."""
    free, cost = end.problem.free, end.here.cost
    along = in_units(there.to - end.x, free, most=NAMED)
    message = (
        f"the gradient vanishes, but this is no minimum: the cost falls along {along}, from "
        f"{cost:.6g} to {cost - there.fall:.6g} at the point that `lower` of the solution holds; "
        "start from there"
    )
    lower = free.unpack(there.to, end.problem.fixed.unpack(end.fixed) if free.parts else None)
    return replace(found, status=Status.SADDLE, message=message, lower=lower)


def _in_valley(end: EndPoint, running: Mask, found: Ending) -> Ending:
    """Which unknowns grow without limit, and how far they have come."""
    places = np.flatnonzero(running)
    labels = end.problem.free.labels_of(places)
    told = [f"{name} = {end.x[i]:.3g}" for name, i in zip(labels, places, strict=True)]
    message = (
        "the cost falls along a valley without end as unknowns grow without limit "
        f"({some_of(told, NAMED)}), and has no minimum there; bound them, give them a prior, or "
        "choose other unknowns, such as their inverses"
    )
    return replace(found, status=Status.VALLEY, message=message, running=tuple(labels))
