"""The algorithms of NLopt; a run counts, keeps the best point and judges it."""

from dataclasses import KW_ONLY, dataclass

import nlopt
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.errors import check_known
from workbench.problem import Problem
from workbench.problem.constraint_set import ConstraintSet
from workbench.solvers.abilities import Abilities, Derivative
from workbench.solvers.limits import Limits, Stop
from workbench.solvers.nlopt_algorithms import ALGORITHMS
from workbench.solvers.nlopt_objective import Objective
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status

MEANING = {  # of the result codes that end a run by themselves
    nlopt.FAILURE: (Status.STALLED, "it gave up; try another algorithm"),
    nlopt.INVALID_ARGS: (Status.STALLED, "it does not take this problem; try another algorithm"),
    nlopt.OUT_OF_MEMORY: (Status.STALLED, "out of memory; try an algorithm without a full matrix"),
    nlopt.ROUNDOFF_LIMITED: (
        Status.STALLED,
        "rounding errors kept it from going on; diagnose the problem",
    ),
    nlopt.MAXEVAL_REACHED: (Status.MAX_EVALUATIONS, Status.MAX_EVALUATIONS.value),
    nlopt.MAXTIME_REACHED: (Status.MAX_SECONDS, Status.MAX_SECONDS.value),
}
GAVE_UP = (nlopt.SUCCESS, nlopt.FTOL_REACHED, nlopt.XTOL_REACHED)  # nothing more to be gained

STEP_SECONDS = {"LD_SLSQP": 1e-8}  # times n^3: a step that NLopt does not interrupt; 10 s at 1,000
SMALLEST_STEP = 1e-14  # of a trust region: COBYLA halves one for ever, asking for nothing


@dataclass(frozen=True)
class Nlopt(Limits):
    """An algorithm of NLopt (Johnson, The NLopt nonlinear-optimization package).

    NLopt sees the unknowns y_i = |J_i| x_i, with the Jacobian at the start: quasi-Newton methods
    begin with the identity as their Hessian, and after this scaling its diagonal is right. Raises
    UnknownName for an algorithm that is not in `nlopt_algorithms.ALGORITHMS`, which names the
    source of each.

    Attributes:
        algorithm: NLopt's name of the algorithm, such as `LD_LBFGS`.
        local: the algorithm of the descents of MLSL; others do not read it.
        seed: of the stochastic algorithms.
        cost_tolerance: the relative decrease of the cost in one step below which NLopt gives up. A
            larger one ends earlier; whether the point has converged is judged by
            `gradient_tolerance` all the same.
    """

    algorithm: str = "LD_LBFGS"
    local: str = "LD_LBFGS"
    seed: int = 0
    cost_tolerance: float = 1e-16  # less than a single bit; at 1e-15 BOBYQA stops short
    _: KW_ONLY
    max_iterations: int = 100_000
    max_evaluations: int = 20_000

    def __post_init__(self) -> None:
        for name in (self.algorithm, self.local):
            check_known("NLopt algorithm here", name, ALGORITHMS)

    @property
    def abilities(self) -> Abilities:
        """The entry of `ALGORITHMS`."""
        return ALGORITHMS[self.algorithm]

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`.

        Raises NotSupported for bounds or constraints that the algorithm does not take, and for
        missing bounds that it needs.
        """
        name = f"nlopt {self.algorithm}"
        with Run(name, self, problem, start, callback) as run:
            x0, here = run.x, run.begin()
            self._check_the_step(x0.size)
            scale = np.where(here.column_norms > 0, here.column_norms, 1.0)
            optimizer = self._optimizer(self.algorithm, x0.size)
            objective = Objective(run, here, scale, optimizer, self.abilities)
            optimizer.set_min_objective(objective.cost)
            optimizer.set_lower_bounds(problem.lower * scale)
            optimizer.set_upper_bounds(problem.upper * scale)
            if problem.stacked_constraints is not None:
                _constrain(optimizer, objective, problem.stacked_constraints)
            if self.algorithm.startswith("G_MLSL"):
                optimizer.set_local_optimizer(self._optimizer(self.local, x0.size))
            if self.algorithm.startswith("LN_"):
                optimizer.set_initial_step(np.maximum(0.1 * scale, np.finfo(float).tiny))
                optimizer.set_xtol_rel(SMALLEST_STEP)
            nlopt.srand(self.seed)
            try:
                self._optimize(run, optimizer, x0, scale)
            except (SystemError, ValueError, RuntimeError, MemoryError) as error:
                # an interrupt while NLopt was at its own work, or what it says of its arguments
                if objective.error is None and isinstance(error, SystemError):
                    raise error.__cause__ or error from None
                objective.error = objective.error or Stop(
                    Status.STALLED, f"nlopt {self.algorithm} refused: {error or type(error)}"
                )
            if objective.error is not None:
                raise objective.error
            run.check()  # some leave at a limit without saying so
            code = optimizer.last_optimize_result()
            status, advice = MEANING.get(code, (Status.STALLED, Status.STALLED.value))
            message = f"{advice} (nlopt: result {code})"
            if status is Status.STALLED:
                run.stall(message)
            raise Stop(status, message)
        return run.solution()

    def _check_the_step(self, n: int) -> None:
        """Stop the run if a single step in n unknowns would take longer than `max_seconds`."""
        seconds = STEP_SECONDS.get(self.algorithm, 0.0) * n**3
        if seconds > self.max_seconds:
            raise Stop(
                Status.MAX_SECONDS,
                f"one step of {self.algorithm} in {n} unknowns takes about {seconds:.0f} s and "
                f"cannot be interrupted, more than max_seconds ({self.max_seconds:g}); raise it, "
                "or take a solver for many unknowns",
            )

    def _optimize(self, run: Run, optimizer: nlopt.opt, x0: Array, scale: Array) -> None:
        """Run the optimizer.

        A local one that uses gradients is run again from the best point as long as the cost falls:
        MMA and CCSA end as soon as one step happens to gain nothing, even far from a minimum.
        """
        problem, x, cost = run.problem, x0, run.best.cost
        descends = self.abilities.derivative is Derivative.GRADIENT and not self.abilities.is_global
        while True:
            y = np.clip(x * scale, problem.lower * scale, problem.upper * scale)
            _optimize_quietly(optimizer, y)
            gave_up = optimizer.last_optimize_result() in GAVE_UP
            if not (descends and gave_up and run.best.violation <= 1 and run.best.cost < cost):
                return
            noise = run.rounding_noise.of_cost(run.best.x, run.linearize(run.best.x))
            if run.best.cost >= cost - noise:
                return
            x, cost = run.best.x, run.best.cost

    def _optimizer(self, algorithm: str, n: int) -> nlopt.opt:
        optimizer = nlopt.opt(getattr(nlopt, algorithm), n)
        if hasattr(optimizer, "set_exceptions_enabled"):  # from NLopt 2.10 on
            optimizer.set_exceptions_enabled(False)
        optimizer.set_ftol_rel(self.cost_tolerance)
        optimizer.set_maxeval(self.max_evaluations + 1)
        optimizer.set_maxtime(max(self.max_seconds, 1e-3))
        return optimizer


def _optimize_quietly(optimizer: nlopt.opt, y: Array) -> None:
    """Optimize from y (n,). What NLopt before 2.10 raises is what its last result says too."""
    try:
        optimizer.optimize(y)
    except (nlopt.ForcedStop, nlopt.RoundoffLimited, nlopt.exception):
        if optimizer.last_optimize_result() > 0:
            raise


def _constrain(optimizer: nlopt.opt, objective: Objective, there: ConstraintSet) -> None:
    """Give the constraints to NLopt in its form: h(x) = 0 and g(x) <= 0."""
    equal, above, below = there.equal, np.isfinite(there.upper), np.isfinite(there.lower)
    if equal.any():
        rows = objective.rows(there, equal, 1.0, there.lower)
        optimizer.add_equality_mconstraint(rows, there.tolerance[equal])
    for wanted, sign, limit in (
        (above & ~equal, 1.0, there.upper),
        (below & ~equal, -1.0, there.lower),
    ):
        if wanted.any():
            rows = objective.rows(there, wanted, sign, limit)
            optimizer.add_inequality_mconstraint(rows, there.tolerance[wanted])
