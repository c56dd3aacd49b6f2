"""Solvers, each by its own name, and the catalogue by which the command line knows them.

A solver runs its loop in a `Run`, which evaluates, counts, keeps the best point and stops; how a
run ended is judged by the problem (`judgement`), never by what a library reports. One that cannot
take bounds or constraints says so in its `abilities`, from which the refusal is made.
"""

from collections.abc import Mapping

from workbench.blocks import Values
from workbench.errors import BadArgument, check_known
from workbench.problem import Problem
from workbench.solvers.abilities import Abilities, Boxes, Derivative
from workbench.solvers.casadi_solvers import (
    DampedGaussNewton,
    Ipopt,
    Sqp,
    exact_hessian,
    gauss_newton_hessian,
)
from workbench.solvers.dogleg import Dogleg, RadiusRule, chumpy, textbook
from workbench.solvers.gauss_newton import (
    GaussNewton,
    SteepestDescent,
    backtracking,
    full_step,
)
from workbench.solvers.levenberg_marquardt import LevenbergMarquardt
from workbench.solvers.limits import Limits
from workbench.solvers.newton import Newton
from workbench.solvers.nlopt import Nlopt
from workbench.solvers.run import Run
from workbench.solvers.scipy import Scipy
from workbench.solvers.solution import (
    Callback,
    Evaluations,
    Hypothesis,
    Iterate,
    Solution,
    Solver,
    Status,
    checked,
)
from workbench.solvers.staged import SolveStage, Staged
from workbench.solvers.starts import Draw, Spread, Starts, within_bounds
from workbench.solvers.trust_region import TrustRegion, columns, identity

# Solvers by the names that the command line knows; `workbench solvers` prints what each can do.
SOLVERS: Mapping[str, Limits] = {
    "trust-region": TrustRegion(),
    "gauss-newton": GaussNewton(),
    "gauss-newton-full": GaussNewton(line_search=full_step),
    "levenberg-marquardt": LevenbergMarquardt(),
    "levenberg-marquardt-columns": LevenbergMarquardt(scaling=columns, first_damping=1e-5),
    "dogleg": Dogleg(),
    "dogleg-chumpy": Dogleg(rule=chumpy),
    "steepest-descent": SteepestDescent(),
    "newton": Newton(),
    "ipopt": Ipopt(),
    "ipopt-exact": Ipopt(hessian=exact_hessian),
    "ipopt-lbfgs": Ipopt(hessian=None, max_iterations=3_000),
    "sqp": Sqp(),
    "scipy-trf": Scipy("trf"),
    "scipy-dogbox": Scipy("dogbox"),
    "scipy-lm": Scipy("lm"),
    "nlopt-lbfgs": Nlopt("LD_LBFGS"),
    "nlopt-tnewton": Nlopt("LD_TNEWTON_PRECOND_RESTART"),
    "nlopt-var2": Nlopt("LD_VAR2"),
    "nlopt-slsqp": Nlopt("LD_SLSQP"),
    "nlopt-mma": Nlopt("LD_MMA"),
    "nlopt-ccsaq": Nlopt("LD_CCSAQ"),
    "nlopt-bobyqa": Nlopt("LN_BOBYQA"),
    "nlopt-mlsl": Nlopt("G_MLSL_LDS"),
}
DEFAULT = "trust-region"  # the solver of `solve` and of the commands, where none is named


def solve(
    problem: Problem,
    start: Values,
    solver: Solver | str | None = None,
    *,
    callback: Callback = None,
) -> Solution:
    """Minimise the cost of a problem over its free blocks, from starting values.

    `start` has an array for every block that the problem reads, free and fixed, in the unit of the
    block. `solver` is any Solver, or the name of one in `SOLVERS`, as the commands take it; without
    one it is TrustRegion(), which honours bounds (Moré 1978). `callback` is called with each
    Iterate, and ends the run if it returns True. The Solution says how the run ended; its point is
    never worse than the start, moved inside the bounds.

    Raises BadArgument for what is no Problem or no solver, UnknownName for a name that is not in
    `SOLVERS`, NotSupported for bounds or constraints that the solver does not take, and what
    `Problem.split` raises for values that do not fit.
    """
    if not isinstance(problem, Problem):
        raise BadArgument(f"a Problem is solved, not something of type {type(problem).__name__}")
    solver = DEFAULT if solver is None else solver
    if isinstance(solver, str):
        check_known("solver", solver, SOLVERS)
        solver = SOLVERS[solver]
    return checked(solver).solve(problem, start, callback=callback)


__all__ = [
    "DEFAULT",
    "SOLVERS",
    "Abilities",
    "Boxes",
    "Callback",
    "DampedGaussNewton",
    "Derivative",
    "Dogleg",
    "Draw",
    "Evaluations",
    "GaussNewton",
    "Hypothesis",
    "Ipopt",
    "Iterate",
    "LevenbergMarquardt",
    "Limits",
    "Newton",
    "Nlopt",
    "RadiusRule",
    "Run",
    "Scipy",
    "Solution",
    "SolveStage",
    "Solver",
    "Spread",
    "Sqp",
    "Staged",
    "Starts",
    "Status",
    "SteepestDescent",
    "TrustRegion",
    "backtracking",
    "chumpy",
    "columns",
    "exact_hessian",
    "full_step",
    "gauss_newton_hessian",
    "identity",
    "solve",
    "textbook",
    "within_bounds",
]
