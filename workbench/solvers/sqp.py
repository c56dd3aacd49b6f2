"""CasADi's sequential quadratic programming, with a damped Gauss-Newton Hessian."""

from dataclasses import KW_ONLY, dataclass

import casadi as cs

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities
from workbench.solvers.damping import DAMPED
from workbench.solvers.limits import Limits, Stop
from workbench.solvers.oracle import Hessian, Oracle, abilities_with, unless_solved
from workbench.solvers.run import Run
from workbench.solvers.solution import Callback, Solution, Status

OPTIONS = {
    "no_nlp_grad": True,
    "tol_pr": 1e-10,  # the run's own tolerance is asked for at every iterate
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
}


@dataclass(frozen=True)
class Sqp(Limits):
    """Sequential quadratic programming, by `sqpmethod` of CasADi.

    Every step solves a quadratic program with the Hessian of the Lagrangian and the linearized
    constraints, and a line search on the l1 merit function goes along its solution (Nocedal and
    Wright, Numerical Optimization, 2006, chapter 18). Where the Hessian is not positive definite,
    it is made so: see `Oracle.convex_hessian`.

    Attributes:
        hessian: the Hessian of the cost: `Damped` (Gauss and Newton's, with Levenberg and
            Marquardt's damping), `gauss_newton_hessian`, `exact_hessian`, or a function of the run,
            x (n,) and the linearization there. That of the constraints is added.
    """

    hessian: Hessian = DAMPED
    _: KW_ONLY
    max_iterations: int = 200

    @property
    def abilities(self) -> Abilities:
        """It needs a Jacobian at every iterate, and takes bounds and constraints."""
        source = "Nocedal and Wright 2006, chapter 18; CasADi's sqpmethod"
        return abilities_with(self.hessian, source)

    def solve(self, problem: Problem, start: Values, *, callback: Callback = None) -> Solution:
        """Solve from `start`, which is moved inside the bounds; see `Solver`."""
        with Run("sqp", self, problem, start, callback) as run:
            unless_solved(run, self.hessian)
            run.stall(f"{Status.STALLED.value} (sqpmethod: {self._ask(run)})")
        return run.solution()

    def _ask(self, run: Run) -> str:
        """Run CasADi's solver; its own word for how it ended."""
        n, oracle = run.problem.free.size, Oracle(run, self.hessian)
        x, none, _, y = oracle.symbols.values()
        cost, gradient = oracle.cost(x, none), oracle.gradient(x, none)
        c, A = none, cs.MX(0, n)
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
                **OPTIONS,
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
