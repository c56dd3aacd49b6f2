"""Solvers, each by its own name, and the catalogue by which the command line knows them."""

from collections.abc import Mapping

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.solvers.gauss_newton import GaussNewton, backtracking, full_step
from workbench.solvers.ipopt import Ipopt, exact_hessian, gauss_newton_hessian
from workbench.solvers.levenberg_marquardt import LevenbergMarquardt, columns, identity
from workbench.solvers.nlopt import Nlopt
from workbench.solvers.solution import (
    Callback,
    Evaluations,
    Iterate,
    Solution,
    Solver,
    Status,
)

SOLVERS: Mapping[str, Solver] = {
    "gauss-newton": GaussNewton(),
    "levenberg-marquardt": LevenbergMarquardt(),
    "ipopt": Ipopt(),
    "ipopt-exact": Ipopt(hessian=exact_hessian),
    "nlopt-lbfgs": Nlopt("LD_LBFGS"),
    "nlopt-tnewton": Nlopt("LD_TNEWTON_PRECOND_RESTART"),
    "nlopt-slsqp": Nlopt("LD_SLSQP"),
    "nlopt-mma": Nlopt("LD_MMA"),
    "nlopt-bobyqa": Nlopt("LN_BOBYQA"),
}


def solve(
    problem: Problem,
    start: Values,
    solver: Solver | None = None,
    *,
    callback: Callback | None = None,
) -> Solution:
    """Solve with Levenberg-Marquardt, or with the solver given."""
    return (solver or LevenbergMarquardt()).solve(problem, start, callback=callback)


__all__ = [
    "SOLVERS",
    "Callback",
    "Evaluations",
    "GaussNewton",
    "Ipopt",
    "Iterate",
    "LevenbergMarquardt",
    "Nlopt",
    "Solution",
    "Solver",
    "Status",
    "backtracking",
    "columns",
    "exact_hessian",
    "full_step",
    "gauss_newton_hessian",
    "identity",
    "solve",
]
