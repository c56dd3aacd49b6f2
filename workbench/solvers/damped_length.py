"""The damping at which a step is as long as the radius of a trust region."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from workbench.arrays import Array
from workbench.problem.steps import Step

LEAST, MOST = 0.9, 1.1  # of the radius: a step in between is as long as the radius
TRIALS = 20  # of dampings, before a step that is short enough is taken for want of a better one
POWER = -0.5  # of the damping: how lengths fall with it as long as only one of them is known
FLATTEST, STEEPEST = -0.05, -1.0  # powers; no length falls more steeply
FAR = 1e-2, 0.2  # of a damping: below that, with one or two tried, none at all is tried next
LARGEST = 1e280


class Damped(NamedTuple):
    """A step, None where the linear algebra has no answer, and its damping."""

    step: Step | None
    damping: float


def step_within(
    radius: float,
    damped: Callable[[float], Step | None],
    steepness: float,
    damping: float,
    D: Array | float = 1.0,
) -> Damped:
    """The best step of the linear model that is at most as long as `radius`, and its damping.

    It is the step without damping if that is short enough, else the one with the damping that makes
    it as long as the radius. The length falls with the damping, so this is one equation with one
    unknown, and a tenth of the radius is precise enough (Hebden, An algorithm for minimization
    using exact second derivatives, 1973; Moré, The Levenberg-Marquardt algorithm: implementation
    and theory, 1978, section 5). A secant between the logarithms of both solves it in two or three
    trials.

    `damped` is the step as a function of its damping, `steepness` the length of the gradient, and
    `damping` the first to be tried. In a metric D (n,), the length of a step p is |D p|, and that
    of a gradient g is |g / D|.
    """
    longer, shorter = -1.0, min(steepness / radius, LARGEST)  # dampings that make it so
    tried: list[tuple[float, float]] = []
    damping = min(damping, shorter)
    for _ in range(TRIALS):
        step = damped(damping)
        length = np.inf if step is None else float(np.linalg.norm(D * step.p)) / radius
        if length == 0 or (length <= MOST and (length >= LEAST or damping == 0)):
            return Damped(step, damping)
        if length > 1:
            longer = max(longer, damping)
        else:
            shorter = min(shorter, damping)
        if damping > 0 and np.isfinite(length):
            tried.append((damping, length))
        damping = _guess(tried[-2:], longer, shorter)
    return Damped(damped(shorter), shorter)


def _guess(tried: list[tuple[float, float]], longer: float, shorter: float) -> float:
    """The damping whose length is 1 radius, from one or two that were tried with their lengths."""
    if not tried:
        return shorter / 10
    damping, length = tried[-1]
    power = POWER
    if len(tried) == 2 and tried[0][0] != damping:
        other, its_length = tried[0]
        power = float(np.log(length / its_length) / np.log(damping / other))
    guess = float(damping * np.float64(length) ** (-1 / np.clip(power, STEEPEST, FLATTEST)))
    if longer < 0 and guess < FAR[len(tried) - 1] * damping:
        return 0.0
    if longer < guess < shorter:
        return guess
    return float(np.sqrt(max(longer, 1e-4 * shorter) * shorter))
