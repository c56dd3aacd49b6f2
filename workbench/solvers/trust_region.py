"""The default: damped Gauss-Newton steps, as long as the linear model has proved to be good for."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import BadArgument
from workbench.problem import Linearization, Problem
from workbench.problem.steps import LinearAlgebra, Step, sparing
from workbench.solvers.abilities import IN_A_RADIUS, Abilities, Boxes, Derivative
from workbench.solvers.attempts import Attempts, Left
from workbench.solvers.box_step import box_step
from workbench.solvers.damped_length import step_within
from workbench.solvers.doubt import may_be_repeated
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.scaling import Metric, Scaling, columns, identity
from workbench.solvers.solution import Callback, Solution

TAKEN = 1e-4  # gain ratio above which a step is taken
POOR, GOOD = 0.25, 0.75  # gain ratios: the region shrinks below POOR and may grow from GOOD on
SLOW = 0.1  # of the cost: after a smaller decrease, steps are bent
AHEAD = 0.1  # of a step: where its bend is measured
BENT = 0.75  # of the length of a step: 2 |a| of a bend that is trusted
UNSEEN = 1e-9  # of the cost: a smaller predicted decrease says nothing of the linear model
SHORTEST = 1e-16  # of the size of the point: a smaller region ends the run
SHORTER = 0.1  # of the first radius: that of some further attempts
WAYS: tuple[tuple[Scaling, float], ...] = (  # of attempts: the metric, and the share of the radius
    (identity, 1.0),
    (identity, SHORTER),
    (columns, SHORTER),
    (columns, 1.0),
)


@dataclass(frozen=True)
class TrustRegion(Limits):
    """The Levenberg-Marquardt method with a trust region, and the default of `solve`.

    Every step p minimises the linear model |J p + r| among the steps of at most a certain length,
    the radius of the trust region. It is (J'J + damping I) p = -J'r, with the damping that gives it
    that length, or the Gauss-Newton step where that is short enough. The radius follows the gain
    ratio, which is the actual decrease of the cost over the one that the model predicts: below 1/4
    it is halved, or quartered if the cost rose by as much as it should fall; from 3/4 on, and after
    a Gauss-Newton step of more than 1/4, it becomes twice the length of the step. The first radius
    is the length of the start, or 1 where that is 0, and shrinks to the length of the first step.
    If the start is so near to 0 that the cost cannot tell the first step from none, the radius
    grows tenfold until it can.
    See Moré, The Levenberg-Marquardt algorithm: implementation and theory, 1978. Unlike there, a
    radian, a metre and a standard deviation count the same, whatever the columns of the Jacobian.

    In a long curved valley, steps along straight lines are short. So after a step that lowers the
    cost by less than a tenth, the next one that is damped is bent: p becomes p + a with
    (J'J + damping I) a = -1/2 J'r_pp, where r_pp, the second derivative of the residual along p, is
    measured by one more evaluation, a tenth of the way ahead. It stays straight if 2 |a| is more
    than 3/4 |p| (Transtrum and Sethna, Improvements to the Levenberg-Marquardt algorithm for
    nonlinear least-squares minimization, 2012). Between bounds the step is the best one that stays
    inside.

    A long first step may lead past the nearest minimum. So, with at most 20 unknowns, up to three
    further attempts are made where a lower minimum is likely elsewhere: the end is INSENSITIVE
    or has NO_FINITE_MINIMUM, or it was approached slowly (`solvers.doubt`). The second has a
    tenth of the first radius. The third has that too, and measures steps by the columns of the
    Jacobian, as Moré does: their length is |D p|, and D the largest lengths of the columns so far.
    The fourth does the same with the first radius itself. An attempt that has used half of its
    iterations or evaluations, and creeps, is put aside for the next ones (`solvers.attempts`). An
    attempt that is not lower after a quarter of the evaluations of the first (but at least 50) is
    given up. The solution is the lowest end with its own trace and the evaluations of all attempts.

    Raises BadArgument for a first radius that is not positive and finite, and for less than one
    attempt or more than four.

    Attributes:
        first_radius: the first radius, in the units of the unknowns; None for the length of the
            start. Attempts that measure steps by columns multiply it by the root mean square of D.
        attempts: how often it starts at most, up to 4; 1 for no further attempt.
        linear_algebra: how the step is computed; `sparing` chooses a factorization.
    """

    first_radius: float | None = None
    attempts: int = len(WAYS)
    linear_algebra: LinearAlgebra = sparing
    _: KW_ONLY
    max_iterations: int = 2_000

    def __post_init__(self) -> None:
        if self.first_radius is not None and not 0 < self.first_radius < np.inf:
            raise BadArgument(
                "`first_radius` must be a positive, finite length in the units of the unknowns, or "
                f"None for the length of the start, not {self.first_radius}"
            )
        if not 1 <= self.attempts <= len(WAYS):
            raise BadArgument(f"`attempts` must be from 1 to {len(WAYS)}, not {self.attempts}")

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds."""
        return Abilities(
            Derivative.JACOBIAN,
            Boxes.TAKEN,
            first_step=IN_A_RADIUS,
            source="Moré 1978; Transtrum and Sethna 2012",
        )

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for constraints."""
        most = self.attempts if may_be_repeated(problem, self.gradient_tolerance) else 1

        def attempt(
            number: int, left: Left, callback: Callback, after_step: Callable[[Run], None]
        ) -> Solution:
            limited = replace(
                self,
                max_iterations=left.iterations,
                max_evaluations=left.evaluations,
                max_seconds=left.seconds,
            )
            return limited._attempt(problem, start, callback, after_step, *WAYS[number])

        limits = Left(self.max_iterations, self.max_evaluations, self.max_seconds)
        return Attempts(attempt, most).solve(limits, callback)

    def _first_radius(self, x: Array, D: Array) -> float:
        """The radius at the start x (n,), in the metric D (n,)."""
        if self.first_radius is not None:
            return self.first_radius * float(np.linalg.norm(D) / np.sqrt(x.size))
        return float(np.linalg.norm(D * x)) or 1.0

    def _attempt(
        self,
        problem: Problem,
        start: Values,
        callback: Callback,
        after_step: Callable[[Run], None],
        scaling: Scaling,
        share: float,
    ) -> Solution:
        """One attempt: the end that is reached from `start` with a share of the first radius."""
        with Run("trust-region", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            metric = Metric(scaling)
            D = metric.at(here)
            radius = share * self._first_radius(x, D)
            damping, slow = 0.0, False
            least = SHORTEST * max(float(np.linalg.norm(D * x)), radius)
            unseen = True  # so far, steps have been too short for the cost to show them
            while True:
                steepness = float(np.linalg.norm(here.gradient / D))
                step, damping = step_within(
                    radius, self._damped(problem, x, here, D), steepness, damping, D
                )
                if step is None:
                    run.stall("the columns of the Jacobian are dependent; use automatic")
                length = float(np.linalg.norm(D * step.p))
                predicted = here.predicted_decrease(step.p)
                p = step.p
                if slow and damping > 0:
                    p = p + bend(run, x, here, p, damping, D, self.linear_algebra)
                to = np.clip(x + p, problem.lower, problem.upper)
                gain_ratio = run.gain_ratio(x, here, to, predicted)
                unseen = unseen and damping > 0 and predicted < UNSEEN * here.cost
                if unseen:
                    radius = 10 * length
                    continue
                if len(run.trace) == 1:
                    radius = min(radius, length)
                radius = next_radius(radius, length, gain_ratio, damping)
                if gain_ratio > TAKEN:
                    slow = gain_ratio * predicted < SLOW * here.cost
                    del here  # first: its memory serves the next one
                    x, here = run.move(to, damping, step.by)
                    D = metric.at(here)
                    after_step(run)
                elif radius <= least or np.array_equal(to, x):
                    run.stall()
        return run.solution()

    def _damped(
        self, problem: Problem, x: Array, here: Linearization, D: Array
    ) -> Callable[[float], Step | None]:
        """The step from x (n,) in the metric D (n,) as a function of its damping."""
        low, high = problem.lower - x, problem.upper - x
        return lambda damping: box_step(here, damping, D, low, high, self.linear_algebra)


def next_radius(radius: float, length: float, gain_ratio: float, damping: float) -> float:
    """The radius of the trust region after a step of this length; see `TrustRegion`."""
    if not gain_ratio > POOR:
        return min(radius, 10 * length) * (1 / 2 if gain_ratio > -1 else 1 / 4)
    if gain_ratio >= GOOD or damping == 0:  # without damping it is a Gauss-Newton step
        return 2 * length
    return radius


def bend(
    run: Run,
    x: Array,
    here: Linearization,
    p: Array,
    damping: float,
    D: Array,
    solve: LinearAlgebra,
) -> Array:
    """The a (n,) by which the residual's second derivative along the step p (n,) bends it.

    It is 0 where it is no small correction. See `TrustRegion`.
    """
    ahead = np.clip(x + AHEAD * p, run.problem.lower, run.problem.upper)
    residual = run.evaluate("residual", lambda: run.problem.residual(ahead, run.fixed))
    r_pp = 2 / AHEAD * ((residual - here.residual) / AHEAD - here.along(p))
    curved = here.with_residual(0.5 * r_pp)
    step = solve(curved, damping, D) if np.isfinite(curved.gradient).all() else None
    if step is None or not 2 * np.linalg.norm(D * step.p) <= BENT * np.linalg.norm(D * p):
        return np.zeros_like(p)
    return step.p
