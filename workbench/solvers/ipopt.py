"""IPOPT's interior point method, fed with our own derivatives."""

from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Stop
from workbench.solvers.oracle import Hessian, Oracle, exact_hessian, gauss_newton_hessian
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status

MEANING = {  # of the return codes; `Run.solution` decides about convergence itself
    "Solve_Succeeded": Status.CONVERGED,
    "Solved_To_Acceptable_Level": Status.STALLED,
    "Feasible_Point_Found": Status.STALLED,
    "Search_Direction_Becomes_Too_Small": Status.STALLED,
    "Restoration_Failed": Status.STALLED,
    "Error_In_Step_Computation": Status.STALLED,
    "Diverging_Iterates": Status.STALLED,
    "Not_Enough_Degrees_Of_Freedom": Status.INFEASIBLE,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Maximum_CpuTime_Exceeded": Status.MAX_SECONDS,
    "Maximum_WallTime_Exceeded": Status.MAX_SECONDS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
    "User_Requested_Stop": Status.STOPPED,
    **dict.fromkeys(
        (
            "Invalid_Problem_Definition",
            "Invalid_Option",
            "Unrecoverable_Exception",
            "NonIpopt_Exception_Thrown",
            "Insufficient_Memory",
            "Internal_Error",
        ),
        Status.STALLED,
    ),
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
class Ipopt:
    """A primal-dual interior point method with a filter line search (Waechter and Biegler 2006).

    `hessian` is that of the cost; the constraints' own is added. With None, IPOPT makes one of
    gradients (limited memory BFGS).
    """

    hessian: Hessian | None = gauss_newton_hessian
    max_iterations: int = 300
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """Everything is taken; what is asked for depends on the Hessian."""
        exact = self.hessian not in (None, gauss_newton_hessian)
        return Abilities(
            Derivative.HESSIAN if exact else Derivative.JACOBIAN,
            Boxes.TAKEN,
            equations=True,
            inequalities=True,
            source="Waechter and Biegler 2006",
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Bounds and constraints are honoured; the start is moved inside the bounds."""
        names = (("ipopt", gauss_newton_hessian), ("ipopt-exact", exact_hessian))
        name = next((n for n, h in names if h is self.hessian), "ipopt-own")
        if self.hessian is None:
            name = "ipopt-lbfgs"
        with Run(name, self, problem, start, callback) as run:
            x0 = np.clip(run.x, problem.lower, problem.upper)
            run.unless_solved(x0)  # a start that is not finite ends the run here, too
            answer = self._ask(run, x0)
            status = MEANING.get(answer, Status.STALLED)
            message = f"{ADVICE.get(answer, status.value)} (ipopt: {answer})"
            if status is Status.STALLED:
                run.stall(message)
            raise Stop(status, message)
        return run.solution()

    def _ask(self, run: Run, x0: Array) -> str:
        problem, n, there = run.problem, run.problem.free.size, run.problem.stacked_constraints
        k = 0 if there is None else there.size
        oracle = Oracle(run, self.hessian)
        x, p, weight, y = cs.MX.sym("x", n), cs.MX(0, 1), cs.MX.sym("f"), cs.MX.sym("y", k)
        none = cs.MX(0, 1)
        cost, gradient = oracle.cost(x, none), oracle.gradient(x, none)
        unread = cs.MX.nan()  # beside the gradient, where CasADi's interface wants a cost
        nlp = {"x": x, "f": cost}
        derivatives = {
            "grad_f": cs.Function("g", [x, p], [unread, gradient], ["x", "p"], ["f", "grad_f_x"])
        }
        limits = {"lbx": problem.lower, "ubx": problem.upper} if problem.bounded else {}
        if there is not None:
            nlp["g"] = oracle.constraints(x, none)
            derivatives["jac_g"] = cs.Function(
                "j",
                [x, p],
                [nlp["g"], oracle.constraint_jacobian(x, none)],
                ["x", "p"],
                ["g", "jac_g_x"],
            )
            limits |= {"lbg": there.lower, "ubg": there.upper}
        if self.hessian is not None:
            bend = weight * oracle.hessian(x, none)
            if there is not None:
                bend += oracle.constraint_hessian(x, y)
            derivatives["hess_lag"] = cs.Function(
                "h",
                [x, p, weight, y],
                [cs.triu(bend)],
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            )
        solver = cs.nlpsol(
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
                "ipopt": {
                    "print_level": 0,
                    "sb": "yes",
                    "max_iter": self.max_iterations,
                    "max_wall_time": max(self.max_seconds, 1e-3),
                    "tol": 1e-16,  # ours is asked for at every iterate; theirs must not come first
                    "acceptable_iter": 0,
                    "bound_relax_factor": 0.0,
                    "nlp_scaling_method": "none",
                    "hessian_approximation": "exact" if self.hessian else "limited-memory",
                },
            },
        )
        solver(x0=x0, **limits)
        if oracle.error is not None:
            raise oracle.error
        return str(solver.stats()["return_status"])
