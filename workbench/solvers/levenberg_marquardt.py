"""The Levenberg-Marquardt method: Gauss-Newton steps, damped as long as they gain too little."""

from dataclasses import KW_ONLY, dataclass

import numpy as np

from workbench.blocks import Values
from workbench.blocks.checks import above_zero
from workbench.problem import Problem
from workbench.problem.steps import EPS, LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, box_step, identity

FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body
LARGEST_STIFFNESS = 1e140  # |J_i| / D_i: its square, damped, is still a number


def eased(gain_ratio: float) -> float:
    """The factor of the damping after a step with a gain ratio above zero, from 0.1 to 2.

    See Nielsen, Damping parameter in Marquardt's method, 1999.
    """
    return float(max(FASTEST_FALL, 1 - (2 * gain_ratio - 1) ** 3))


@dataclass(frozen=True)
class LevenbergMarquardt(Limits):
    """The Levenberg-Marquardt method: (J'J + damping D^2) p = -J'r.

    The damping follows the gain ratio, which is the actual decrease of the cost over the decrease
    that the linear model predicts. A good step lowers the damping smoothly; a bad one is not taken
    and raises it faster and faster (Nielsen, Damping parameter in Marquardt's method, 1999; Madsen,
    Nielsen and Tingleff, Methods for non-linear least squares problems, 2004, section 3.2). The
    entries of D never decrease, so that an unknown whose column vanishes on the way is still damped
    (Moré, The Levenberg-Marquardt algorithm: implementation and theory, 1978). If the predicted
    decrease is so small that rounding errors hide it, the damping is lowered first, until a
    decrease can be seen or the damping is negligible: it may be so large that it suppresses every
    step in an unknown whose column is much shorter than the others. Between bounds the step is the
    best one that stays inside.

    Raises BadArgument for a first damping that is not positive and finite.

    Attributes:
        scaling: the metric D of a step. `identity`: a radian, a metre and a standard deviation are
            damped alike (Levenberg 1944); `columns`: units of unknowns do not matter (Marquardt
            1963).
        linear_algebra: how the step is computed; `automatic` chooses a factorization.
        first_damping: the damping at the start, as a share of the largest (|J_i| / D_i)^2 there. A
            larger one begins with shorter steps, nearer to the gradient.
    """

    scaling: Scaling = identity
    linear_algebra: LinearAlgebra = automatic
    first_damping: float = 1e-3
    _: KW_ONLY
    max_iterations: int = 2_000

    def __post_init__(self) -> None:
        super().__post_init__()
        above_zero("LevenbergMarquardt", first_damping=self.first_damping)

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds."""
        source = "Levenberg 1944; Marquardt 1963; Moré 1978; Nielsen 1999"
        return Abilities(Derivative.JACOBIAN, Boxes.TAKEN, source=source)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for constraints."""
        with Run("levenberg-marquardt", self, problem, start, callback) as run:
            x, here = run.x, run.linearize(run.x)
            D = self.scaling(here)
            stiffness = np.minimum(here.column_norms / D, LARGEST_STIFFNESS)
            stiffest = float(np.max(stiffness**2, initial=1e-300))
            damping, growth = self.first_damping * stiffest, 2.0
            least = EPS**2 * stiffest  # where columns differ by 1e16, the shortest still count
            run.record(x, here.cost, here, damping)
            while True:
                low, high = problem.lower - x, problem.upper - x
                step = box_step(here, damping, D, low, high, self.linear_algebra)
                stuck = False
                if step is not None:
                    predicted = here.predicted_decrease(step.p)
                    may_lower = growth == 2.0 and damping > least
                    if may_lower and run.rounding_noise.hides(predicted, x, here):
                        damping *= FASTEST_FALL  # the decrease of a longer step may be visible
                        continue
                    to = np.clip(x + step.p, problem.lower, problem.upper)
                    gain_ratio = run.gain_ratio(x, here, to, predicted)
                    if gain_ratio > 0:
                        damping *= eased(gain_ratio)
                        growth = 2.0
                        del here  # first: its memory serves the next one
                        x, here = run.move(to, damping, step.by)
                        D = np.maximum(D, self.scaling(here))
                        continue
                    stuck = np.array_equal(to, x)
                if stuck or not damping <= 1e16 * stiffest:
                    run.stall()
                damping *= growth
                growth *= 2
        return run.solution()
