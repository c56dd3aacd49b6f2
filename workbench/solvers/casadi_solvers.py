"""The solvers that CasADi calls, IPOPT and its own SQP, and the Hessians that they use."""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, eye_array

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.problem.sparsity import Pattern
from workbench.problem.storage import Stored, gram_of_nonzeros, is_sparse, unblocked
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.dogleg import first_radius
from workbench.solvers.levenberg_marquardt import FASTEST_FALL, eased
from workbench.solvers.limits import Limits, Stop
from workbench.solvers.oracle import Oracle, StoredBy
from workbench.solvers.run import Run, has_one_pass
from workbench.solvers.solution import Callback, Solution, Status

RISE_PER_TRIAL = 4.0  # of the damping, for each step that was tried in vain
MOST_RISES = 8  # such steps that count
SMALLEST_DAMPING = 1e-12  # of the largest entry of J'J: instead of less there is none
LARGEST_DAMPING = 1e3
DAMPED_AGAIN_FROM = 1e-6  # of that entry: from here it rises, if it was below
STATUS_OF_RESULT = {  # for IPOPT's return codes; STALLED for others
    "Solve_Succeeded": Status.CONVERGED,
    "Not_Enough_Degrees_Of_Freedom": Status.INFEASIBLE,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Maximum_CpuTime_Exceeded": Status.MAX_SECONDS,
    "Maximum_WallTime_Exceeded": Status.MAX_SECONDS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
    "User_Requested_Stop": Status.STOPPED,
}
ADVICE = {  # where the status alone does not say it
    "Restoration_Failed": "the way back to the constraints was not found; start nearer to them",
    "Error_In_Step_Computation": "its linear system broke down; diagnose the problem",
    "Diverging_Iterates": "the unknowns run away; bound the blocks or give them a prior",
    "Not_Enough_Degrees_Of_Freedom": "more equations than unknowns; free more blocks",
    "Infeasible_Problem_Detected": "no point near here meets the constraints; relax them",
    "Invalid_Problem_Definition": "it does not take this problem; try another solver",
    "Insufficient_Memory": "out of memory; use the Gauss-Newton or the limited-memory Hessian",
}
SQP_OPTIONS = {
    "no_nlp_grad": True,
    "tol_pr": 1e-10,  # the run's own tolerance is asked for at every iterate
    "tol_du": 1e-14,
    "min_step_size": 1e-14,
    "max_iter_ls": 30,
    "c1": 1e-4,
    "elastic_mode": True,  # where the linearized constraints contradict each other
    "qpsol": "qrqp",
    "qpsol_options": dict.fromkeys(
        ("print_iter", "print_header", "print_info", "error_on_fail"), False
    ),
    **dict.fromkeys(("print_header", "print_iteration", "print_status"), False),
    **dict.fromkeys(("print_time", "show_eval_warnings", "error_on_fail"), False),
}


def exact_hessian(run: Run, x: Array, here: Linearization) -> Stored:
    """The Hessian of the cost (n, n), J'J + sum r_i H_i, by differentiation of the whole graph.

    It is sparse if it is large and most of it is zero.
    """
    return run.hessian(x)


@dataclass(frozen=True)
class DampedGaussNewton:
    """The Gauss-Newton Hessian, damped: J'J + damping d I, with d the largest entry of J'J.

    It is for solvers that take a Hessian and have a line search. Where J'J is nearly singular,
    their steps are so long that the line search cuts nearly all of each, whereas a damped step is
    short in the weak directions alone. The damping rises if the line search cut the step; otherwise
    it follows the gain ratio, as in the Levenberg-Marquardt method (Madsen, Nielsen and Tingleff,
    Methods for non-linear least squares problems, 2004, section 3.2). At the start it is raised
    until the damped step is no longer than `first_radius`. With constraints there is no damping,
    for a line search then cuts steps for the sake of the constraints, too.

    Attributes:
        first_damping: the least damping at the start, as a share of the largest entry of J'J; 0 for
            no damping along the whole run.
    """

    first_damping: float = 1e-3

    def along(self, run: Run) -> StoredBy:
        """A function of x (n,) and of multipliers to the Hessian (n, n), for one run."""
        if run.problem.stacked_constraints is not None or not self.first_damping > 0:
            return lambda x, _: unblocked(run.linearize(x).normal)
        return _Damping(run, self.first_damping)


Hessian = Callable[[Run, Array, Linearization], Stored] | DampedGaussNewton
DAMPED_HESSIAN = DampedGaussNewton()
# J'J itself, positive semidefinite, and exact where the residual vanishes
gauss_newton_hessian = DampedGaussNewton(first_damping=0.0)


class _Last(NamedTuple):
    """The point at which the last Hessian was asked for, and how many trials there had been."""

    x: Array
    cost: float
    gradient: Array
    hessian: Stored
    trials: int


class _Damping:
    """The damped Hessian along a run; the damping follows what happened since the last one."""

    def __init__(self, run: Run, first_damping: float) -> None:
        self._run, self._damping = run, first_damping
        self._last: _Last | None = None

    def __call__(self, x: Array, multipliers: Array) -> Stored:
        run, last = self._run, self._last
        here = run.linearize(x)
        largest = float(here.column_norms.max(initial=0.0) ** 2)
        if last is None:
            radius = first_radius(x, np.ones_like(x))
            while self._damping < LARGEST_DAMPING and not (
                float(np.linalg.norm(here.step(self._damping * largest))) <= radius
            ):
                self._damping *= 2.0
        elif np.array_equal(x, last.x):
            return last.hessian
        else:
            damping = min(self._next(last, x, here), LARGEST_DAMPING)
            self._damping = damping if damping > SMALLEST_DAMPING else 0.0
        H, added = unblocked(here.normal), self._damping * largest
        if isinstance(H, csc_array):
            H = csc_array(H + added * eye_array(len(x)))
        else:
            H = H + added * np.eye(len(x))
        self._last = _Last(x.copy(), here.cost, here.gradient, H, self._trials)
        return H

    @property
    def _trials(self) -> int:
        return self._run.meter.counts["residual"] + self._run.one_pass.at_once

    def _next(self, last: _Last, x: Array, here: Linearization) -> float:
        """The damping after the step from the last point to x."""
        cut = self._trials - last.trials - 1
        if cut > 0:
            return max(self._damping, DAMPED_AGAIN_FROM) * RISE_PER_TRIAL ** min(cut, MOST_RISES)
        p = x - last.x
        predicted = -float(last.gradient @ p) - 0.5 * float(p @ (last.hessian @ p))
        if predicted <= 0:  # the step was not to lower the cost, but to meet bounds
            return self._damping
        if self._run.rounding_noise.hides(predicted, x, here):
            return self._damping * FASTEST_FALL
        gain_ratio = (last.cost - here.cost) / predicted
        return self._damping * (eased(gain_ratio) if gain_ratio > 0 else 2.0)


def _abilities(hessian: Hessian | None, source: str) -> Abilities:
    """What a solver of CasADi can do with this Hessian: it takes bounds and constraints."""
    by_jacobian = isinstance(hessian, DampedGaussNewton | None)
    return Abilities(
        Derivative.JACOBIAN if by_jacobian else Derivative.HESSIAN,
        Boxes.TAKEN,
        equations=True,
        inequalities=True,
        source=source,
    )


def _along(run: Run, hessian: Hessian) -> StoredBy:
    """The Hessian of the cost as a function of x and of multipliers, which it does not read."""
    if isinstance(hessian, DampedGaussNewton):
        return hessian.along(run)

    def of_user(x: Array, _: Array) -> Stored:
        H = hessian(run, x, run.linearize(x))
        return H if isinstance(H, csc_array) else np.asarray(H)

    return of_user


def _nonzeros(problem: Problem, hessian: Hessian) -> csc_array | None:
    """Where the Hessian of the cost can be nonzero, if it is J'J or exact, and sparse."""
    n = problem.free.size
    if isinstance(hessian, DampedGaussNewton) and problem.sparse:
        normal = gram_of_nonzeros(csc_array(problem.pattern, dtype=float))
        return csc_array(normal + eye_array(n))
    if hessian is exact_hessian:
        pattern = Pattern(problem.hessian.sparsity_out(0))
        count = len(pattern.rows)
        return pattern.matrix(np.ones(count)) if is_sparse(n, n, count) else None
    return None


def _begin(run: Run, hessian: Hessian | None) -> None:
    """End the run if its start is already a solution; then no solver has to be made.

    Trials are linearized at once if the Hessian needs J'J and one pass gives all.
    """
    run.one_pass.on = isinstance(hessian, DampedGaussNewton) and has_one_pass(run.problem)
    here = run.linearize(run.x)
    if run.rounding_noise.optimality(run.x, here) <= run.limits.gradient_tolerance:
        run.record(run.x, here.cost, here)


@dataclass(frozen=True)
class Ipopt(Limits):
    """IPOPT: a primal-dual interior-point method with a filter line search.

    See Waechter and Biegler, On the implementation of an interior-point filter line-search
    algorithm for large-scale nonlinear programming, 2006.

    Attributes:
        hessian: the Hessian of the cost: `DampedGaussNewton`, `gauss_newton_hessian`,
            `exact_hessian`, a function of the run, x (n,) and the linearization there, or None,
            with which IPOPT approximates the Hessian from gradients (limited-memory BFGS). That of
            the constraints is added.
    """

    hessian: Hessian | None = DAMPED_HESSIAN
    _: KW_ONLY
    max_iterations: int = 300

    @property
    def abilities(self) -> Abilities:
        """It takes bounds and constraints; what it needs depends on `hessian`."""
        return _abilities(self.hessian, "Waechter and Biegler 2006")

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`."""
        with Run("ipopt", self, problem, start, callback) as run:
            _begin(run, self.hessian)  # a start that is not finite ends the run here, too
            return_status = self._ask(run)
            status = STATUS_OF_RESULT.get(return_status, Status.STALLED)
            message = f"{ADVICE.get(return_status, status.value)} (ipopt: {return_status})"
            if status is Status.STALLED:
                run.stall(message)
            raise Stop(status, message)
        return run.solution()

    def _ask(self, run: Run) -> str:
        """Run IPOPT; its own word for how it ended."""
        hessian = self.hessian or DAMPED_HESSIAN  # limited-memory BFGS does not ask for it
        oracle = Oracle(run, _along(run, hessian), _nonzeros(run.problem, hessian))
        solver = self._function(oracle, run.problem.stacked_constraints is not None)
        oracle.minimize(solver)
        return str(solver.stats()["return_status"])

    def _function(self, oracle: Oracle, constrained: bool) -> cs.Function:
        """IPOPT as a function of CasADi, which asks the oracle's functions."""
        x, none, weight, y = oracle.symbols.values()
        nlp = {"x": x, "f": oracle.cost(x, none)}
        # CasADi's interface wants a cost beside the gradient, and does not read it
        first = {"f": cs.MX.nan(), "grad_f_x": oracle.gradient(x, none)}
        derivatives = {"grad_f": oracle.function(("x", "p"), first)}
        if constrained:
            nlp["g"] = oracle.constraints(x, none)
            rows = {"g": nlp["g"], "jac_g_x": oracle.constraint_jacobian(x, none)}
            derivatives["jac_g"] = oracle.function(("x", "p"), rows)
        if self.hessian is not None:
            H = weight * oracle.hessian(x, none)
            if constrained:
                H += oracle.constraint_hessian(x, y)
            second = {"triu_hess_gamma_x_x": cs.triu(H)}
            derivatives["hess_lag"] = oracle.function(tuple(oracle.symbols), second)
        options = {
            "print_level": 0,
            "sb": "yes",
            "max_iter": self.max_iterations,
            "max_wall_time": max(self.max_seconds, 1e-3),
            "tol": 1e-16,  # the run's tolerance is asked for at every iterate, and must come first
            "acceptable_iter": 0,
            "bound_relax_factor": 0.0,
            "nlp_scaling_method": "none",
            "hessian_approximation": "exact" if self.hessian else "limited-memory",
        }
        return cs.nlpsol(
            "ipopt",
            "ipopt",
            nlp,
            {
                **derivatives,
                "iteration_callback": oracle.recorder,
                "no_nlp_grad": True,  # its gradient would have to be derived from the callback
                **dict.fromkeys(("print_time", "show_eval_warnings", "error_on_fail"), False),
                "ipopt": options,
            },
        )


@dataclass(frozen=True)
class Sqp(Limits):
    """Sequential quadratic programming, by `sqpmethod` of CasADi.

    Every step solves a quadratic program with the Hessian of the Lagrangian and the linearized
    constraints, and a line search on the l1 merit function goes along its solution (Nocedal and
    Wright, Numerical Optimization, 2006, chapter 18). Where the Hessian is not positive definite,
    it is made so: see `Oracle.convex_hessian`.

    Attributes:
        hessian: the Hessian of the cost: `DampedGaussNewton`, `gauss_newton_hessian`,
            `exact_hessian`, or a function of the run, x (n,) and the linearization there. That of
            the constraints is added.
    """

    hessian: Hessian = DAMPED_HESSIAN
    _: KW_ONLY
    max_iterations: int = 200

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds and constraints."""
        return _abilities(self.hessian, "Nocedal and Wright 2006, chapter 18; CasADi's sqpmethod")

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`."""
        with Run("sqp", self, problem, start, callback) as run:
            _begin(run, self.hessian)
            oracle = Oracle(run, _along(run, self.hessian), _nonzeros(problem, self.hessian))
            run.stall(f"{Status.STALLED.value} (sqpmethod: {self._ask(run, oracle)})")
        return run.solution()

    def _ask(self, run: Run, oracle: Oracle) -> str:
        """Run CasADi's solver; its own word for how it ended."""
        x, none, _, y = oracle.symbols.values()
        cost, gradient = oracle.cost(x, none), oracle.gradient(x, none)
        c, A = none, cs.MX(0, run.problem.free.size)
        if run.problem.stacked_constraints is not None:
            c, A = oracle.constraints(x, none), oracle.constraint_jacobian(x, none)
        first = {"f": cost, "grad_f_x": gradient, "g": c, "jac_g_x": A}
        second = {"hess_gamma_x_x": oracle.convex_hessian(x, y)}
        solver = cs.nlpsol(
            "sqp",
            "sqpmethod",
            {"x": x, "f": cost, "g": c},
            {
                "jac_fg": oracle.function(("x", "p"), first),
                "hess_lag": oracle.function(tuple(oracle.symbols), second),
                "iteration_callback": oracle.recorder,
                "max_iter": self.max_iterations + 1,
                **SQP_OPTIONS,
            },
        )
        try:
            oracle.minimize(solver)
        except RuntimeError as error:  # the quadratic program has no solution
            if error is oracle.error:
                raise
            last = str(error).strip().splitlines()[-1].rpartition(": ")[2]  # CasADi's own sentence
            raise Stop(Status.INFEASIBLE, f"{Status.INFEASIBLE.value} ({last})") from error
        try:
            return str(solver.stats()["return_status"])
        except RuntimeError:  # CasADi 3.8 has no statistics if the first step met NaN
            return "no status"
