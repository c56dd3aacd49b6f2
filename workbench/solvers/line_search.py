"""Line searches: how far to go along a direction."""

from collections.abc import Callable

from workbench.arrays import Array
from workbench.problem import Linearization
from workbench.solvers.run import Run

LineSearch = Callable[[Run, Array, Linearization, Array], float]


def full_step(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """The whole step, length 1, wherever it leads, as in Gauss's method."""
    return 1.0


def backtracking(run: Run, x: Array, here: Linearization, p: Array) -> float:
    """The first of 1, 1/2, 1/4, ... at which the cost falls by 1e-4 of what its slope predicts.

    This is the condition of Armijo, Minimization of functions having Lipschitz continuous first
    partial derivatives, 1966. It is 0 if no length above 1e-10 fulfils it. Where rounding would
    hide the predicted decrease, it is 1 if the full step leads to a more stationary point, else 0.
    """
    slope = float(here.gradient @ p)
    if run.rounding_noise.hides(-slope / 2, x, here):
        return 1.0 if run.gain_ratio(x, here, x + p, -slope / 2) > 0 else 0.0
    length = 1.0
    while length > 1e-10:
        if run.cost(x + length * p) <= here.cost + 1e-4 * length * slope:
            return length
        length /= 2
    return 0.0
