"""Gauss-Newton and steepest descent: a direction, then a line search along it."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.problem.steps import LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.dogleg import cauchy_point, first_radius, model_holds
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, columns

LENGTH_GROWTH = 2.0  # of a step over the one before
TRUSTED_ERROR = 0.1  # of |J p|: how far the linear model may be off at the end of a long step
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


@dataclass(frozen=True)
class GaussNewton(Limits):
    """The Gauss-Newton method: J'J p = -J'r, then a step along p.

    Where J has no full rank, p is the shortest of the solutions. See Nocedal and Wright, Numerical
    Optimization, 2006, section 10.3. The line search begins inside a radius, so that no step leaps
    to where nothing is known. The first step is shorter than the start is far from zero, or than 1
    near zero, unless the linear model proves right for the whole of it; each later step is at most
    twice as long as the one before, or as long as the linear model was right (`first_radius`,
    `radius_after`).

    Attributes:
        line_search: how far to go along p: `backtracking`, or `full_step`, which always takes the
            whole step, as Gauss did, and heeds no radius.
        linear_algebra: how the step is computed; `automatic` chooses a factorization.
    """

    line_search: LineSearch = backtracking
    linear_algebra: LinearAlgebra = automatic

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes no bounds.

        Without a line search it is meant for teaching.
        """
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.REFUSED,
            teaching=self.line_search is not backtracking,
            source="Gauss 1809; Armijo 1966 (the line search)",
        )

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("gauss-newton", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            radius = np.inf if self.line_search is full_step else first_radius(x, np.ones(len(x)))
            while True:
                step = self.linear_algebra(here, 0.0, np.ones(len(x)))
                if step is None:
                    run.stall("the columns of the Jacobian are dependent; damp, or use automatic")
                p, whole = step.p, float(np.linalg.norm(step.p))
                at_start = len(run.trace) == 1
                if whole > radius and not (at_start and model_holds(run, x, here, p)):
                    p = p * (radius / whole)
                length = self.line_search(run, x, here, p)
                p = length * p
                if np.array_equal(x + p, x):
                    run.stall()
                before, change = here.residual, here.along(p)
                del here  # first: its memory serves the next one
                x, here = run.move(x + p, 0.0, step.by)
                after = radius_after(p, change, here.residual - before - change)
                radius = after if length < 1 else max(radius, after)
        return run.solution()


def radius_after(p: Array, change: Array, error: Array) -> float:
    """How long the step after p (n,) may be: twice as long, and longer where the model was right.

    `change` (m,) is J p, and `error` (m,) by how much the residual at the end of the step is
    another one. As the error grows as the square of the length of a step, its share of the change
    grows as the length; the next step may be so long that it would be a tenth.
    """
    share = float(np.linalg.norm(error)) / max(float(np.linalg.norm(change)), 1e-300)
    return float(np.linalg.norm(p)) * max(LENGTH_GROWTH, TRUSTED_ERROR / max(share, 1e-16))


@dataclass(frozen=True)
class SteepestDescent(Limits):
    """Steps along the negative gradient to the point where the linear model is least along it.

    The difference between the cost and its minimum falls by ((k - 1) / (k + 1))^2 per step, where k
    is the condition of J'J in the metric D (Nocedal and Wright, Numerical Optimization, 2006,
    theorem 3.4). With D = I, units alone can make the method hopelessly slow.

    Attributes:
        scaling: the metric D of the gradient; with `columns`, units of unknowns do not matter.
        line_search: how far to go towards the Cauchy point: `backtracking` or `full_step`.
    """

    scaling: Scaling = columns
    line_search: LineSearch = backtracking
    _: KW_ONLY
    max_iterations: int = 10_000
    max_evaluations: int = 50_000

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian for the length of the step, and is meant for teaching."""
        return Abilities(Derivative.JACOBIAN, Boxes.REFUSED, teaching=True, source="Cauchy 1847")

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for bounds or constraints."""
        with Run("steepest-descent", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            while True:
                p = cauchy_point(here, self.scaling(here))
                to = x + self.line_search(run, x, here, p) * p
                if (to == x).all():
                    run.stall()
                x, here = run.move(to)
        return run.solution()
