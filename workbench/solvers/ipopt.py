"""IPOPT's interior point method, fed with our own derivatives."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Values
from workbench.problem import Linearization, Problem
from workbench.solvers.run import Run, Stop
from workbench.solvers.solution import Callback, Solution, Status

Array = NDArray[np.float64]
Hessian = Callable[[Run, Array, Linearization], Array]

MEANING = {  # of the return codes; `Run.solution` decides about convergence itself
    "Solve_Succeeded": Status.CONVERGED,
    "Solved_To_Acceptable_Level": Status.STALLED,
    "Search_Direction_Becomes_Too_Small": Status.STALLED,
    "Restoration_Failed": Status.STALLED,
    "Error_In_Step_Computation": Status.STALLED,
    "Diverging_Iterates": Status.STALLED,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Maximum_CpuTime_Exceeded": Status.MAX_SECONDS,
    "Maximum_WallTime_Exceeded": Status.MAX_SECONDS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
}


def gauss_newton_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """J'J: positive semidefinite, and exact where the residual vanishes."""
    return here.normal


def exact_hessian(run: Run, x: Array, here: Linearization) -> Array:
    """J'J + sum r_i H_i, by algorithmic differentiation of the whole graph."""
    return run.hessian(x)


@dataclass(frozen=True)
class Ipopt:
    """A primal-dual interior point method with a filter line search (Waechter and Biegler 2006)."""

    hessian: Hessian = gauss_newton_hessian
    max_iterations: int = 300
    max_evaluations: int = 10_000
    max_seconds: float = 600.0
    gradient_tolerance: float = 1e-6

    def solve(
        self, problem: Problem, start: Values, *, callback: Callback | None = None
    ) -> Solution:
        """See Solver. Bounds are honoured; the start is moved inside them."""
        name = "ipopt" if self.hessian is gauss_newton_hessian else "ipopt-exact"
        with Run(name, self, problem, start, callback) as run:
            x0 = np.clip(run.x, problem.lower, problem.upper)
            run.linearize(x0)  # a start that is not finite ends the run here
            answer = self._ask(run, x0)
            status = MEANING.get(answer, Status.STALLED)
            if status is Status.STALLED:
                run.stall(f"{status.value} (ipopt: {answer})")
            raise Stop(status, f"{status.value} (ipopt: {answer})")
        return run.solution()

    def _ask(self, run: Run, x0: Array) -> str:
        problem, n = run.problem, run.problem.free.size
        oracle = _Oracle(run, self.hessian, n)
        x, p, weight, none = cs.MX.sym("x", n), cs.MX(0, 1), cs.MX.sym("f"), cs.MX(0, 1)
        cost, gradient, hessian = oracle.cost(x), oracle.gradient(x), oracle.hessian(x)
        recorder = _Recorder(run, oracle, n)
        solver = cs.nlpsol(
            "ipopt",
            "ipopt",
            {"x": x, "f": cost},
            {
                "grad_f": cs.Function("g", [x, p], [cost, gradient], ["x", "p"], ["f", "grad_f_x"]),
                "hess_lag": cs.Function(
                    "h", [x, p, weight, none], [cs.triu(weight * hessian)],
                    ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
                ),
                "iteration_callback": recorder,
                "no_nlp_grad": True,  # its gradient would have to be derived from the callback
                "print_time": False,
                "show_eval_warnings": False,
                "error_on_fail": False,
                "ipopt": {
                    "print_level": 0,
                    "sb": "yes",
                    "max_iter": self.max_iterations,
                    "max_wall_time": max(self.max_seconds, 1e-3),
                    "tol": 1e-12,  # ours is asked for at every iterate; theirs must not come first
                    "acceptable_iter": 0,
                    "bound_relax_factor": 0.0,
                    "nlp_scaling_method": "none",
                },
            },
        )  # fmt: skip
        solver(x0=x0, lbx=problem.lower, ubx=problem.upper)
        if oracle.error is not None:
            raise oracle.error
        return str(solver.stats()["return_status"])


class _Oracle:
    """Cost, gradient and Hessian as CasADi functions that share one linearization per point."""

    def __init__(self, run: Run, hessian: Hessian, n: int) -> None:
        self.error: BaseException | None = None
        self._linearize = lru_cache(maxsize=2)(lambda key: run.linearize(np.frombuffer(key)))
        self._costs = lru_cache(maxsize=2)(lambda key: run.cost(np.frombuffer(key)))
        at = self._linearize
        self.cost = _External("cost", n, (1, 1), lambda key: self._costs(key), self)
        self.gradient = _External("gradient", n, (n, 1), lambda key: at(key).gradient, self)
        self.hessian = _External(
            "hessian", n, (n, n), lambda key: hessian(run, np.frombuffer(key), at(key)), self
        )

    def linearization(self, x: Array) -> Linearization:
        """At a point that IPOPT has accepted, as a rule already known."""
        return self._linearize(x.tobytes())


class _External(cs.Callback):  # type: ignore[misc]  # casadi's way of calling back
    """A CasADi function of x whose value Python computes; an exception is kept for later."""

    def __init__(
        self, name: str, n: int, shape: tuple[int, int],
        compute: Callable[[bytes], float | Array], oracle: _Oracle,
    ) -> None:  # fmt: skip
        super().__init__()
        self._n, self._shape, self._compute, self._oracle = n, shape, compute, oracle
        self.construct(name, {})

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(self._n, 1)

    def get_sparsity_out(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(*self._shape)

    def eval(self, arguments: list[cs.DM]) -> list[cs.DM]:
        if self._oracle.error is None:
            try:
                return [cs.DM(self._compute(np.asarray(arguments[0]).ravel().tobytes()))]
            except BaseException as error:  # through C++ it would lose its type
                self._oracle.error = error
        return [cs.DM(np.full(self._shape, np.nan))]


class _Recorder(cs.Callback):  # type: ignore[misc]
    """Adds IPOPT's iterates to the trace, and stops it when the run says so."""

    def __init__(self, run: Run, oracle: _Oracle, n: int) -> None:
        super().__init__()
        self._run, self._oracle = run, oracle
        self._sizes = {"x": n, "lam_x": n, "f": 1}
        self.construct("recorder", {})

    def get_n_in(self) -> int:
        return int(cs.nlpsol_n_out())

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(self._sizes.get(cs.nlpsol_out(i), 0), 1)

    def eval(self, arguments: list[cs.DM]) -> list[cs.DM]:
        if self._oracle.error is None:
            try:
                x = np.asarray(arguments[0]).ravel()
                here = self._oracle.linearization(x)
                self._run.record(x, here.cost, self._run.optimality(x, here))
                return [cs.DM(0)]
            except BaseException as error:
                self._oracle.error = error
        return [cs.DM(1)]
