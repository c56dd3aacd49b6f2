"""How far to go along a direction."""

from collections.abc import Callable

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.solvers.run import Run

LineSearch = Callable[[Run, Array, Linearization, Array], float]


def full_step(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """Length 1, whatever happens: the method as Gauss had it."""
    return 1.0


def backtracking(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """Halve until the cost falls by 1e-4 of what its slope promises (Armijo 1966); 0 if it never
    does. Where rounding would hide the promise, 1 if the full step ends at a more stationary point.
    """
    slope = float(here.gradient @ p)
    if run.rounding_noise.hides(-slope / 2, x, here):
        return 1.0 if run.gain_ratio(x, here, x + p, -slope / 2).gain_ratio > 0 else 0.0
    length = 1.0
    while length > 1e-10:
        if run.cost(x + length * p) <= here.cost + 1e-4 * length * slope:
            return length
        length /= 2
    return 0.0
