"""IPOPT's interior point method, fed with our own derivatives."""

from dataclasses import KW_ONLY, dataclass

import casadi as cs

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities
from workbench.solvers.damping import DAMPED, Damped
from workbench.solvers.limits import Limits, Stop
from workbench.solvers.made import made_for
from workbench.solvers.oracle import (
    Hessian,
    Oracle,
    abilities_with,
    exact_hessian,
    gauss_newton_hessian,
    unless_solved,
)
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status

MEANING = {  # of the return codes that are not STALLED; `ending` decides what has converged
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
    "Restoration_Failed": "the way back to the constraints was lost; start nearer to them",
    "Error_In_Step_Computation": "its linear system broke down; diagnose the problem",
    "Diverging_Iterates": "the unknowns run away; bound the blocks or give them a prior",
    "Not_Enough_Degrees_Of_Freedom": "more equations than unknowns; free more blocks",
    "Infeasible_Problem_Detected": "no point near here meets the constraints; relax them",
    "Invalid_Problem_Definition": "it does not take this problem; try another solver",
    "Unrecoverable_Exception": "it broke down inside; try another solver",
    "NonIpopt_Exception_Thrown": "it broke down inside; try another solver",
    "Internal_Error": "it broke down inside; try another solver",
    "Insufficient_Memory": "out of memory; use the Gauss-Newton or the limited-memory Hessian",
}


@dataclass(frozen=True)
class Ipopt(Limits):
    """IPOPT: a primal-dual interior-point method with a filter line search.

    See Waechter and Biegler, On the implementation of an interior-point filter line-search
    algorithm for large-scale nonlinear programming, 2006.

    Attributes:
        hessian: the Hessian of the cost: `Damped` (Gauss and Newton's, with Levenberg and
            Marquardt's damping), `gauss_newton_hessian`, `exact_hessian`, a function of the run,
            x (n,) and the linearization there, or None, with which IPOPT approximates the
            Hessian from gradients (limited-memory BFGS). That of the constraints is added.
    """

    hessian: Hessian | None = DAMPED
    _: KW_ONLY
    max_iterations: int = 300

    @property
    def abilities(self) -> Abilities:
        """It takes bounds and constraints; what it needs depends on `hessian`."""
        return abilities_with(self.hessian, "Waechter and Biegler 2006")

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`."""
        with Run(self._name, self, problem, start, callback) as run:
            unless_solved(run, self.hessian)  # a start that is not finite ends the run here, too
            answer = self._ask(run)
            status = MEANING.get(answer, Status.STALLED)
            message = f"{ADVICE.get(answer, status.value)} (ipopt: {answer})"
            if status is Status.STALLED:
                run.stall(message)
            raise Stop(status, message)
        return run.solution()

    @property
    def _name(self) -> str:
        if self.hessian is None:
            return "ipopt-lbfgs"
        if isinstance(self.hessian, Damped):
            return "ipopt"
        if self.hessian is exact_hessian:
            return "ipopt-exact"
        return "ipopt-gauss-newton" if self.hessian is gauss_newton_hessian else "ipopt-own"

    def _ask(self, run: Run) -> str:
        """Run IPOPT; its own word for how it ended."""
        options = self._name, self.max_iterations, self.max_seconds  # and no Hessian of a user
        with made_for(run.problem, options) as made:
            oracle = Oracle(run, self.hessian, made.functions)
            if made.solver is None:
                made.solver = self._made(oracle, run.problem.stacked_constraints is not None)
            oracle.serve_again()
            oracle.minimize(made.solver)
            return str(made.solver.stats()["return_status"])

    def _made(self, oracle: Oracle, constrained: bool) -> cs.Function:
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
            bend = weight * oracle.hessian(x, none)
            if constrained:
                bend += oracle.constraint_hessian(x, y)
            second = {"triu_hess_gamma_x_x": cs.triu(bend)}
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
                "print_time": False,
                "show_eval_warnings": False,
                "error_on_fail": False,
                "ipopt": options,
            },
        )
