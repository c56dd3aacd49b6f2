"""The Levenberg-Marquardt method: Gauss-Newton steps, damped as long as they gain too little."""

from dataclasses import KW_ONLY, dataclass
from math import isfinite
from typing import NamedTuple

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.checks import above_zero
from workbench.errors import BadArgument
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS, LinearAlgebra, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.run import Evaluated, Run
from workbench.solvers.solution import Callback, Solution
from workbench.solvers.trust_region import Scaling, box_step, identity

FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body
LONGEST_FURTHER = 0.75  # of a step: the next one with the same Jacobian is no longer
LARGEST_STIFFNESS = 1e140  # |J_i| / D_i: its square, damped, is still a number


def eased(gain_ratio: float) -> float:
    """The factor of the damping after a step with a gain ratio above zero, from 0.1 to 2.

    See Nielsen, Damping parameter in Marquardt's method, 1999.
    """
    return float(max(FASTEST_FALL, 1 - (2 * gain_ratio - 1) ** 3))


class Trial(NamedTuple):
    """A point (n,), its predicted decrease of the cost, and its cost and residual if known."""

    to: Array
    predicted: float
    evaluated: Evaluated | None = None


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

    Several steps may be taken with each Jacobian. After the first step p, the next one q solves the
    same equations with the residual at x + p, and so on, as long as each is at most 3/4 as long as
    the one before. Their sum is tried as one step, and if the cost does not fall, p alone; where k
    steps are accepted, the factor of the damping is applied k times. Newton's method with m steps
    for each Jacobian converges with order m + 1 (Shamanskii, A modification of Newton's method,
    1967), and this method with two of them with order 3, if the damping vanishes with the residual
    (Fan, The modified Levenberg-Marquardt method for nonlinear equations with cubic convergence,
    2012). Raises BadArgument for less than one step, and for a first damping that is not positive
    and finite.

    Attributes:
        scaling: the metric D of a step. `identity`: a radian, a metre and a standard deviation are
            damped alike (Levenberg 1944); `columns`: units of unknowns do not matter (Marquardt
            1963).
        linear_algebra: how the step is computed; `automatic` chooses a factorization.
        first_damping: the damping at the start, as a share of the largest (|J_i| / D_i)^2 there. A
            larger one begins with shorter steps, nearer to the gradient.
        steps_per_jacobian: how many steps are taken at most with each Jacobian; 1 for the plain
            method, 2 for Fan's.
    """

    scaling: Scaling = identity
    linear_algebra: LinearAlgebra = automatic
    first_damping: float = 1e-3
    steps_per_jacobian: int = 1
    _: KW_ONLY
    max_iterations: int = 2_000

    def __post_init__(self) -> None:
        super().__post_init__()
        above_zero("LevenbergMarquardt", first_damping=self.first_damping)
        if self.steps_per_jacobian < 1:
            raise BadArgument(
                "`steps_per_jacobian` must be 1, for the plain method, or more, not "
                f"{self.steps_per_jacobian}"
            )

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds."""
        source = "Levenberg 1944; Marquardt 1963; Moré 1978; Nielsen 1999"
        if self.steps_per_jacobian > 1:
            source += "; Shamanskii 1967; Fan 2012"
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
                    trials = self._trials(run, x, here, step.p, predicted, damping, D)
                    taken, trial = len(trials), trials[-1]
                    gain_ratio = run.gain_ratio(x, here, *trial)
                    if taken > 1 and not gain_ratio > 0:  # they lead too far
                        taken, trial = 1, trials[0]
                        gain_ratio = run.gain_ratio(x, here, *trial)
                    if gain_ratio > 0:
                        damping *= eased(gain_ratio) ** taken
                        growth = 2.0
                        del here  # first: its memory serves the next one
                        x, here = run.move(trial.to, damping, step.by)
                        D = np.maximum(D, self.scaling(here))
                        continue
                    stuck = np.array_equal(trial.to, x)
                if stuck or not damping <= 1e16 * stiffest:
                    run.stall()
                damping *= growth
                growth *= 2
        return run.solution()

    def _trials(
        self,
        run: Run,
        x: Array,
        here: Linearization,
        p: Array,
        predicted: float,
        damping: float,
        D: Array,
    ) -> list[Trial]:
        """The step p (n,) from x alone, then together with each further one with this Jacobian."""
        lower, upper = run.problem.lower, run.problem.upper
        length = float(np.linalg.norm(D * p))
        trials = [Trial(np.clip(x + p, lower, upper), predicted)]
        while len(trials) < self.steps_per_jacobian:
            to, predicted, _ = trials[-1]
            cost, residual = run.cost_and_residual(to)
            trials[-1] = Trial(to, predicted, (cost, residual))
            if not isfinite(cost):
                break
            further, longest = here.with_residual(residual), LONGEST_FURTHER * length
            step = box_step(further, damping, D, lower - to, upper - to, self.linear_algebra)
            if step is None or not (length := float(np.linalg.norm(D * step.p))) <= longest:
                break
            p = p + step.p
            to = np.clip(x + p, lower, upper)
            trials.append(Trial(to, predicted + further.predicted_decrease(step.p)))
        return trials
