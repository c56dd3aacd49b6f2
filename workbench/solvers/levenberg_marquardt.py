"""Levenberg-Marquardt: believe the linear model as far as it keeps its promises."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.steps import EPS, LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.box import box_step
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, identity
from workbench.solvers.solution import Callback, Solution

Array = NDArray[np.float64]
FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body
STIFFEST = 1e140  # of a column in the units of its step: the square, damped, is still a number


@dataclass(frozen=True)
class LevenbergMarquardt:
    """(J'J + damping D^2) p = -J'r; the damping follows the gain ratio (Nielsen 1999).

    The gain is the fall of the cost over the fall that the linear model predicts: a good step
    lowers the damping smoothly, a bad one is not taken and raises it faster and faster
    (Madsen, Nielsen and Tingleff, Methods for non-linear least squares problems, 2004, 3.2). D
    never falls: a column that vanishes on the way gives no licence to go anywhere (Moré 1978).
    A step that promises less than rounding hides is not tried before the damping is as low as it
    may be: what holds it back may be the damping of a column that is much shorter than others.
    Between bounds the step is the best one that stays inside.
    """

    scaling: Scaling = identity
    linear_algebra: LinearAlgebra = automatic
    first_damping: float = 1e-3  # of the largest (|J_i| / D_i)^2 at the start
    max_iterations: int = 200
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Jacobian at every iterate; bounds."""
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.TAKEN,
            source="Levenberg 1944; Marquardt 1963; Moré 1978; Nielsen 1999",
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver; a start outside the bounds is moved inside. Raises NotSupported for
        constraints.
        """
        refuse("levenberg-marquardt", self.abilities, problem)
        with Run("levenberg-marquardt", self, problem, start, callback) as run:
            x = np.clip(run.x, problem.lower, problem.upper)
            here = run.linearize(x)
            D = self.scaling(here)
            stiffness = np.minimum(here.column_norms / D, STIFFEST)
            stiffest = float(np.max(stiffness**2, initial=1e-300))
            damping, growth = self.first_damping * stiffest, 2.0
            least = EPS**2 * stiffest  # where columns differ by 1e16, the shortest still count
            run.record(x, here.cost, run.optimality(x, here), damping)
            while True:
                low, high = problem.lower - x, problem.upper - x
                step = box_step(here, damping, D, low, high, self.linear_algebra)
                if step is not None:
                    to = np.clip(x + step.p, problem.lower, problem.upper)
                    promised = here.promise(step.p)
                    if growth == 2.0 and damping > least and run.roughness.hides(promised, x, here):
                        damping *= FASTEST_FALL  # a longer step may promise what can be seen
                        continue
                    trial = run.gain(x, here, to, promised)
                    if trial.gain > 0:
                        x, here = run.wrapped(to, trial.there or run.linearize(to))
                        D = np.maximum(D, self.scaling(here))
                        damping *= max(FASTEST_FALL, 1 - (2 * trial.gain - 1) ** 3)
                        growth = 2.0
                        run.record(x, here.cost, run.optimality(x, here), damping, step.by)
                        continue
                if not damping <= 1e16 * stiffest or (step is not None and np.array_equal(to, x)):
                    run.stall()
                damping *= growth
                growth *= 2
        return run.solution()
