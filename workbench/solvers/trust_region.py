"""The default: damped Gauss-Newton steps, as long as the linear model has proved to be good for."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.blocks.checks import above_zero
from workbench.problem import Linearization, Problem
from workbench.problem.steps import LinearAlgebra, Step, sparing
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Limits
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution

LEAST_GAIN = 1e-4  # a step with a gain ratio above this is taken
POOR, GOOD = 0.25, 0.75  # gain ratios: the region shrinks below POOR and may grow from GOOD on
SLOW_DECREASE = 0.1  # of the cost: after a smaller decrease, steps follow the geodesic
PROBE_LENGTH = 0.1  # of a step: where the second derivative along it is measured
LARGEST_ACCELERATION = 0.75  # 2 |a| / |p| of an acceleration a of the step p that is trusted
SMALLEST_RADIUS = 1e-16  # of the size of the point: a smaller one ends the run
SHORTEST_STEP, LONGEST_STEP = 0.9, 1.1  # of the radius: in between, a step is as long as that
MOST_TRIALS = 20  # of dampings; then a step that is short enough is taken
FIRST_POWER = -0.5  # of the damping, by which lengths fall, as long as only one of them is known
FLATTEST, STEEPEST = -0.05, -1.0  # powers; no length falls more steeply than by -1
UNDAMPED_BELOW = 1e-2, 0.2  # of the last damping, after one and two: no damping is tried next
LARGEST_DAMPING = 1e280  # of dampings
ACTIVE_SET_ROUNDS = 20  # of holding and releasing in a box; every one of them is feasible

Scaling = Callable[[Linearization], Array]


def identity(here: Linearization) -> Array:
    """The metric D = I (n,): a radian, a metre and a standard deviation of shape count the same.

    See Levenberg, A method for the solution of certain non-linear problems in least squares, 1944.
    """
    return np.ones(here.shape[1])


def columns(here: Linearization) -> Array:
    """The metric D = diag |J_i| (n,): units of unknowns do not matter.

    See Marquardt, An algorithm for least-squares estimation of nonlinear parameters, 1963. This
    suits regressions. On bodies it hardly damps the unknowns that change the residual least, which
    then move far without need.
    """
    return np.where(here.column_norms > 0, here.column_norms, 1.0)


@dataclass(frozen=True)
class TrustRegion(Limits):
    """The Levenberg-Marquardt method with a trust region, and the default of `solve`.

    Every step p minimises the linear model |J p + r| among the steps of at most a certain length,
    the radius of the trust region. It is (J'J + damping I) p = -J'r, with the damping that gives it
    that length, or the Gauss-Newton step where that is short enough. The radius follows the gain
    ratio, the actual decrease of the cost over the predicted one: below 1/4 it is halved, or
    quartered if the cost rose by as much as it should fall, beginning at ten times the length of
    the step at most; from 3/4 on, and after a Gauss-Newton step of more than 1/4, it becomes twice
    that length. The first radius is the length of the start, but at least 1, and shrinks to the
    length of the first step. See Moré, The Levenberg-Marquardt algorithm: implementation and
    theory, 1978. Unlike there, a radian, a metre and a standard deviation count the same. Between
    bounds the step is the best one that stays inside.

    In a long curved valley, steps along straight lines are short. So after a step that lowers the
    cost by less than a tenth, the next one that is damped gets a geodesic acceleration: p becomes
    p + a with (J'J + damping I) a = -1/2 J'r_pp, where r_pp, the second derivative of the residual
    along p, is measured by one more evaluation. It is left out if 2 |a| is more than 3/4 |p|
    (Transtrum and Sethna, Improvements to the Levenberg-Marquardt algorithm for nonlinear
    least-squares minimization, 2012).

    Raises BadArgument for a first radius that is not positive and finite.

    Attributes:
        first_radius: the first radius, in the units of the unknowns; None for the length of the
            start, but at least 1.
        linear_algebra: how the step is computed; `sparing` chooses a factorization.
    """

    first_radius: float | None = None
    linear_algebra: LinearAlgebra = sparing
    _: KW_ONLY
    max_iterations: int = 2_000

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first_radius is not None:
            above_zero("TrustRegion", first_radius=self.first_radius)

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds."""
        source = "Moré 1978; Transtrum and Sethna 2012"
        return Abilities(Derivative.JACOBIAN, Boxes.TAKEN, source=source)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`; see `Solver`. Raises NotSupported for constraints."""
        with Run("trust-region", self, problem, start, callback) as run:
            x, here = run.x, run.begin()
            size = float(np.linalg.norm(x))
            radius = self.first_radius or max(size, 1.0)
            damping, slow = 0.0, False
            least = SMALLEST_RADIUS * max(size, radius)
            while True:
                steepness = float(np.linalg.norm(here.gradient))
                # nothing may hold what `_damped` returns, for that holds `here`
                step, damping = step_within(
                    radius, self._damped(problem, x, here), steepness, damping
                )
                if step is None:
                    run.stall("the columns of the Jacobian are dependent; use automatic")
                length = float(np.linalg.norm(step.p))
                predicted = here.predicted_decrease(step.p)
                p = step.p
                if slow and damping > 0:
                    p = p + geodesic_acceleration(run, x, here, p, damping, self.linear_algebra)
                to = np.clip(x + p, problem.lower, problem.upper)
                gain_ratio = run.gain_ratio(x, here, to, predicted)
                if len(run.trace) == 1:
                    radius = min(radius, length)
                radius = next_radius(radius, length, gain_ratio, damping)
                if gain_ratio > LEAST_GAIN:
                    slow = gain_ratio * predicted < SLOW_DECREASE * here.cost
                    del here  # first: its memory serves the next one
                    x, here = run.move(to, damping, step.by)
                elif radius <= least or np.array_equal(to, x):
                    run.stall()
        return run.solution()

    def _damped(
        self, problem: Problem, x: Array, here: Linearization
    ) -> Callable[[float], Step | None]:
        """The step from x (n,) as a function of its damping."""
        low, high, D = problem.lower - x, problem.upper - x, np.ones(x.size)
        return lambda damping: box_step(here, damping, D, low, high, self.linear_algebra)


def next_radius(radius: float, length: float, gain_ratio: float, damping: float) -> float:
    """The radius of the trust region after a step of this length; see `TrustRegion`."""
    if not gain_ratio > POOR:
        return min(radius, 10 * length) * (1 / 2 if gain_ratio > -1 else 1 / 4)
    if gain_ratio >= GOOD or damping == 0:  # without damping it is a Gauss-Newton step
        return 2 * length
    return radius


def geodesic_acceleration(
    run: Run, x: Array, here: Linearization, p: Array, damping: float, solve: LinearAlgebra
) -> Array:
    """The geodesic acceleration a (n,) of a step p (n,); 0 where it is no small correction.

    See `TrustRegion`.
    """
    ahead = np.clip(x + PROBE_LENGTH * p, run.problem.lower, run.problem.upper)
    residual = run.evaluate("residual", lambda: run.problem.residual(ahead, run.fixed))
    r_pp = 2 / PROBE_LENGTH * ((residual - here.residual) / PROBE_LENGTH - here.along(p))
    second = here.with_residual(0.5 * r_pp)
    step = solve(second, damping, np.ones(x.size)) if np.isfinite(second.gradient).all() else None
    if step is None or not 2 * np.linalg.norm(step.p) <= LARGEST_ACCELERATION * np.linalg.norm(p):
        return np.zeros_like(p)
    return step.p


def step_within(
    radius: float,
    damped: Callable[[float], Step | None],
    steepness: float,
    damping: float,
) -> tuple[Step | None, float]:
    """The best step of the linear model that is at most as long as `radius`, and its damping.

    It is the step without damping if that is short enough, else the one with the damping that makes
    it as long as the radius, to a tenth (Hebden, An algorithm for minimization using exact second
    derivatives, 1973; Moré 1978, section 5). A secant between the logarithms of both solves it in
    two or three trials. `damped` is the step as a function of its damping, None where the linear
    algebra has no answer; `steepness` is the length of the gradient, and `damping` the first tried.
    """
    # the largest damping whose step is longer than the radius, and the smallest of shorter ones
    longer, shorter = -1.0, min(steepness / radius, LARGEST_DAMPING)
    tried: list[tuple[float, float]] = []
    damping = min(damping, shorter)
    for _ in range(MOST_TRIALS):
        step = damped(damping)
        length = np.inf if step is None else float(np.linalg.norm(step.p)) / radius
        if length == 0 or (length <= LONGEST_STEP and (length >= SHORTEST_STEP or damping == 0)):
            return step, damping
        if length > 1:
            longer = max(longer, damping)
        else:
            shorter = min(shorter, damping)
        if damping > 0 and np.isfinite(length):
            tried.append((damping, length))
        damping = _guess(tried[-2:], longer, shorter)
    return damped(shorter), shorter


def _guess(tried: list[tuple[float, float]], longer: float, shorter: float) -> float:
    """The damping whose length is 1 radius, from one or two that were tried with their lengths."""
    if not tried:
        return shorter / 10
    damping, length = tried[-1]
    power = FIRST_POWER
    if len(tried) == 2 and tried[0][0] != damping:
        other, its_length = tried[0]
        power = float(np.log(length / its_length) / np.log(damping / other))
    guess = float(damping * np.float64(length) ** (-1 / np.clip(power, STEEPEST, FLATTEST)))
    if longer < 0 and guess < UNDAMPED_BELOW[len(tried) - 1] * damping:
        return 0.0
    if longer < guess < shorter:
        return guess
    return float(np.sqrt(max(longer, 1e-4 * shorter) * shorter))


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
    for _ in range(ACTIVE_SET_ROUNDS):
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
