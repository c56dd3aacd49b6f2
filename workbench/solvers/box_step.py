"""The damped step inside a box, by an active-set method."""

import numpy as np

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.problem.steps import LinearAlgebra, Step

ROUNDS = 20  # of holding and releasing, before what is there is taken: it is feasible in any case


def box_step(
    here: Linearization, damping: float, D: Array, low: Array, high: Array, solve: LinearAlgebra
) -> Step | None:
    """The p that minimises |J p + r|^2 + damping |D p|^2 with low <= p <= high, low <= 0 <= high.

    It is found by an active-set method (Nocedal and Wright, Numerical Optimization, 2006, section
    16.5): entries that leave the box are held at its sides, the rest is solved again, and then
    those that the gradient pulls back inside are released. Near a solution it is the damped step in
    the entries that no bound stops, and takes as little time. None where `solve` has no answer.
    """
    g = here.gradient
    held = ((low >= 0) & (g > 0)) | ((high <= 0) & (g < 0)) | (low >= high)
    if not held.any():  # the common case: nothing is in the way
        step = solve(here, damping, D)
        if step is None or ((low <= step.p) & (step.p <= high)).all():
            return step
    p = np.zeros_like(g)
    by = ""
    for _ in range(ROUNDS):
        if not held.all():
            if here.by_frames:  # frames stay alike; what is held stays
                whole = solve(here.holding(held, p), damping, D)
                step = None if whole is None else Step(whole.p[~held], whole.by)
            else:
                step = solve(here.without(held, p), damping, D[~held])
            if step is None:
                return None
            p[~held], by = step.p, step.by
        outside = ~held & ((p < low) | (p > high))
        if outside.any():
            p, held = np.clip(p, low, high), held | outside
            continue
        slope = g + here.normal @ p + damping * D**2 * p
        inwards = ((p <= low) & (slope < 0)) | ((p >= high) & (slope > 0))
        released = held & inwards & (low < high)
        if not released.any():
            break
        held &= ~released
    return Step(np.clip(p, low, high), by)
