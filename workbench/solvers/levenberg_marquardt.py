"""Levenberg-Marquardt: believe the linear model as far as it keeps its promises."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS, LinearAlgebra, Step, automatic
from workbench.solvers.abilities import Abilities, Boxes, Derivative, refuse
from workbench.solvers.run import Run
from workbench.solvers.scaling import Scaling, identity
from workbench.solvers.solution import Callback, Solution

FASTEST_FALL = 0.1  # of the damping in one step; the paper's 1/3 needs 4 more on a noiseless body
STIFFEST = 1e140  # of a column in the units of its step: the square, damped, is still a number
ROUNDS = 20  # of holding and releasing, before what is there is taken: it is feasible in any case


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
                    predicted = here.predicted_decrease(step.p)
                    if (
                        growth == 2.0
                        and damping > least
                        and run.rounding_noise.hides(predicted, x, here)
                    ):
                        damping *= FASTEST_FALL  # a longer step may promise what can be seen
                        continue
                    trial = run.gain_ratio(x, here, to, predicted)
                    if trial.gain_ratio > 0:
                        if (there := trial.there) is None:
                            del here  # first: its memory serves the next one
                            there = run.linearize(to)
                        x, here = run.wrapped(to, there)
                        D = np.maximum(D, self.scaling(here))
                        damping *= max(FASTEST_FALL, 1 - (2 * trial.gain_ratio - 1) ** 3)
                        growth = 2.0
                        run.record(x, here.cost, run.optimality(x, here), damping, step.by)
                        continue
                if not damping <= 1e16 * stiffest or (step is not None and np.array_equal(to, x)):
                    run.stall()
                damping *= growth
                growth *= 2
        return run.solution()


def box_step(
    here: Linearization, damping: float, D: Array, low: Array, high: Array, solve: LinearAlgebra
) -> Step | None:
    """The p least in |J p + r|^2 + damping |D p|^2 with low <= p <= high, low <= 0 <= high.

    By an active set: entries that leave the box are held at its sides and the rest is solved
    again; then those are released that are pulled back inside. So near a solution it is the
    damped step in the entries that no bound stops, and as quick.
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
            step = _in_the_rest(here, held, p, damping, D, solve)
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


def _in_the_rest(
    here: Linearization,
    held: Mask,
    p: Array,
    damping: float,
    D: Array,
    solve: LinearAlgebra,
) -> Step | None:
    """The step in the entries that are not held, once the held ones have moved by p."""
    if not here.by_frames:
        return solve(here.without(held, p), damping, D[~held])
    whole = solve(here.holding(held, p), damping, D)  # frames stay alike; what is held stays
    return None if whole is None else Step(whole.p[~held], whole.by)
