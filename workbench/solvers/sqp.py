"""CasADi's sequential quadratic programming, with Gauss and Newton's Hessian."""

from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.limits import Stop
from workbench.solvers.oracle import Hessian, Oracle, gauss_newton_hessian
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status


@dataclass(frozen=True)
class Sqp:
    """At every iterate a quadratic program: the Lagrangian's Hessian, the constraints linearized.

    Where that Hessian is not positive definite its eigenvalues lose their signs.
    A line search on the l1 merit function goes along its answer (`sqpmethod` of CasADi; Nocedal
    and Wright, Numerical optimization, 2006, chapter 18).
    """

    hessian: Hessian = gauss_newton_hessian
    max_iterations: int = 200
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    @property
    def abilities(self) -> Abilities:
        """A Jacobian at every iterate; bounds and constraints."""
        exact = self.hessian is not gauss_newton_hessian
        return Abilities(
            Derivative.HESSIAN if exact else Derivative.JACOBIAN,
            Boxes.TAKEN,
            equations=True,
            inequalities=True,
            source="Nocedal and Wright 2006, chapter 18; CasADi's sqpmethod",
        )

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Bounds and constraints are honoured; the start is moved inside the bounds."""
        with Run("sqp", self, problem, start, callback) as run:
            x0 = np.clip(run.x, problem.lower, problem.upper)
            run.unless_solved(x0)
            answer = self._ask(run, x0)
            run.stall(f"{Status.STALLED.value} (sqpmethod: {answer})")
        return run.solution()

    def _ask(self, run: Run, x0: Array) -> str:
        problem, n, there = run.problem, run.problem.free.size, run.problem.stacked_constraints
        k = 0 if there is None else there.size
        oracle = Oracle(run, self.hessian)
        x, p, weight, y = cs.MX.sym("x", n), cs.MX(0, 1), cs.MX.sym("f"), cs.MX.sym("y", k)
        none = cs.MX(0, 1)
        cost, gradient = oracle.cost(x, none), oracle.gradient(x, none)
        c, A = oracle.constraints(x, none), oracle.constraint_jacobian(x, none)
        if there is None:
            c, A = cs.MX(0, 1), cs.MX(0, n)
        limits = {} if there is None else {"lbg": there.lower, "ubg": there.upper}
        solver = cs.nlpsol(
            "sqp",
            "sqpmethod",
            {"x": x, "f": cost, "g": c},
            {
                "jac_fg": cs.Function(
                    "jac_fg",
                    [x, p],
                    [cost, gradient, c, A],
                    ["x", "p"],
                    ["f", "grad_f_x", "g", "jac_g_x"],
                ),
                "hess_lag": cs.Function(
                    "hess_lag",
                    [x, p, weight, y],
                    [oracle.convex_hessian(x, y)],
                    ["x", "p", "lam_f", "lam_g"],
                    ["hess_gamma_x_x"],
                ),
                "iteration_callback": oracle.recorder,
                "no_nlp_grad": True,
                "max_iter": self.max_iterations + 1,
                "tol_pr": 1e-10,  # ours is asked for at every iterate
                "tol_du": 1e-14,
                "min_step_size": 1e-14,
                "max_iter_ls": 30,
                "c1": 1e-4,
                "elastic_mode": True,  # where the linearized constraints contradict each other
                "qpsol": "qrqp",
                "qpsol_options": {
                    "print_iter": False,
                    "print_header": False,
                    "print_info": False,
                    "error_on_fail": False,
                },
                "print_header": False,
                "print_iteration": False,
                "print_status": False,
                "print_time": False,
                "show_eval_warnings": False,
                "error_on_fail": False,
            },
        )
        try:
            solver(x0=x0, lbx=problem.lower, ubx=problem.upper, **limits)
        except RuntimeError as error:  # of the quadratic program, if not of ours
            if oracle.error is None:
                raise Stop(
                    Status.INFEASIBLE, f"{Status.INFEASIBLE.value} ({_last(error)})"
                ) from error
        if oracle.error is not None:
            raise oracle.error
        try:
            return str(solver.stats()["return_status"])
        except RuntimeError:  # CasADi 3.8 has none where the first step met no number
            return "no status"


def _last(error: Exception) -> str:
    """CasADi's own sentence, at the end of where it was."""
    return str(error).strip().splitlines()[-1].rpartition(": ")[2]
