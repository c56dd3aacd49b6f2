"""The algorithms of NLopt that ask for no more than a cost, and perhaps its gradient."""

from dataclasses import dataclass

import nlopt
import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.errors import UnknownName
from workbench.problem import Problem
from workbench.solvers.run import Run, Stop
from workbench.solvers.solution import Callback, Solution, Status

Array = NDArray[np.float64]

ALGORITHMS = {  # ours: name, whether it takes bounds
    "LD_LBFGS": True,
    "LD_TNEWTON_PRECOND_RESTART": True,
    "LD_SLSQP": True,
    "LD_MMA": True,
    "LN_BOBYQA": True,
}
CHECK_EVERY = 10  # gradients between two looks at the problem's own measure of convergence


@dataclass(frozen=True)
class Nlopt:
    """An algorithm by NLopt's own name, in variables scaled by what they do at the start.

    NLopt sees y_i = |J_i| x_i: quasi-Newton methods begin with the identity for a Hessian, and
    after this scaling its diagonal is right. `cost_tolerance` is the relative fall of the cost
    below which NLopt gives up; whether that point has converged, the problem says.
    """

    algorithm: str = "LD_LBFGS"
    max_iterations: int = 100_000
    max_evaluations: int = 20_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6
    cost_tolerance: float = 1e-16  # not by a single bit; at 1e-15 BOBYQA stops short

    def __post_init__(self) -> None:
        if self.algorithm not in ALGORITHMS:
            raise UnknownName("NLopt algorithm here", self.algorithm, ALGORITHMS)

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Bounds are honoured; the start is moved inside them."""
        with Run(f"nlopt {self.algorithm}", self, problem, start, callback) as run:
            x0 = np.clip(run.x, problem.lower, problem.upper)
            here = run.linearize(x0)
            run.record(x0, here.cost, run.optimality(x0, here))
            scale = np.where(here.column_norms > 0, here.column_norms, 1.0)
            optimizer = nlopt.opt(getattr(nlopt, self.algorithm), x0.size)
            objective = _Objective(run, scale, optimizer)
            optimizer.set_exceptions_enabled(False)
            optimizer.set_min_objective(objective)
            optimizer.set_lower_bounds(problem.lower * scale)
            optimizer.set_upper_bounds(problem.upper * scale)
            optimizer.set_ftol_rel(self.cost_tolerance)
            optimizer.set_maxeval(self.max_evaluations + 1)
            optimizer.set_maxtime(max(self.max_seconds, 1e-3))
            if self.algorithm.startswith("LN_"):
                optimizer.set_initial_step(0.1 * scale)
            try:
                optimizer.optimize(x0 * scale)
            except SystemError as error:  # an interrupt while NLopt was at its own work
                raise error.__cause__ or error from None
            if objective.error is not None:
                raise objective.error
            code = optimizer.last_optimize_result()
            run.stall(f"{Status.STALLED.value} (nlopt: result {code})")
        return run.solution()


class _Objective:
    """The cost in NLopt's variables; what is raised inside stops NLopt and is kept for later."""

    def __init__(self, run: Run, scale: Array, optimizer: nlopt.opt) -> None:
        self.run, self.scale, self.optimizer = run, scale, optimizer
        self.error: BaseException | None = None
        self.lowest = np.inf

    def __call__(self, y: Array, gradient: Array) -> float:
        if self.error is None:
            try:
                problem = self.run.problem  # y / scale may leave the bounds by a rounding
                x = np.clip(y / self.scale, problem.lower, problem.upper)
                return self._evaluate(x, gradient)
            except BaseException as error:
                self.error = error
                self.optimizer.force_stop()
        gradient[:] = 0.0
        return float(self.run.best_cost)

    def _evaluate(self, x: Array, gradient: Array) -> float:
        run = self.run
        if gradient.size:
            cost, g = run.cost_and_gradient(x)
            gradient[:] = g / self.scale
        else:
            cost = run.cost(x)
        if not np.isfinite(cost):  # NLopt's algorithms do not survive it
            raise Stop(Status.NOT_FINITE)
        if cost < self.lowest:
            self.lowest = cost
            optimality = np.nan
            if gradient.size and len(run.trace) % CHECK_EVERY == 0:
                optimality = run.optimality(x, run.linearize(x))
            run.record(x, cost, optimality)
        return cost
