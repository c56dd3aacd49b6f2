"""SciPy's least-squares solvers as a user calls them, without the workbench around them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.optimize

from workbench.blocks import Values
from workbench.problem import Problem
from workbench.problem.storage import dense
from workbench.solvers import DEFAULT, SOLVERS, Solver, Status

TIGHT = 1e-15


@dataclass(frozen=True)
class Answer:
    """What a peer returns, with the attributes that a comparison reads of a solution."""

    values: Values
    cost: float
    status: Status
    message: str


@dataclass(frozen=True)
class Peer:
    """`scipy.optimize.least_squares` with an exact Jacobian and the tightest tolerances.

    Attributes:
        method: `trf`, `dogbox` or `lm`.
        x_scale: None for the method's default, or `jac`.
    """

    method: str
    x_scale: Any = None

    def solve(self, problem: Problem, start: Values, **_: Any) -> Answer:
        """Solve from `start`. Raises what SciPy raises."""
        x, fixed = problem.split(start)
        missing = max(0, x.size - problem.size) if self.method == "lm" else 0
        with np.errstate(all="ignore"):
            found: Any = scipy.optimize.least_squares(
                lambda x: np.append(problem.residual(x, fixed), np.zeros(missing)),
                x,
                lambda x: np.vstack(
                    [dense(problem.linearize_at(x, fixed).jacobian), np.zeros((missing, x.size))]
                ),
                method=self.method,
                x_scale=self.x_scale,
                ftol=TIGHT,
                xtol=TIGHT,
                gtol=TIGHT,
                max_nfev=100_000,
            )
        status = Status.CONVERGED if found.success else Status.MAX_EVALUATIONS
        return Answer(problem.values(found.x, fixed), float(found.cost), status, found.message)


@dataclass(frozen=True)
class AsItComes:
    """A solver with the limits and the tolerance that it comes with.

    A comparison gives its limits to solvers that have such options; this one has none to be seen.
    """

    solver: Solver

    def solve(self, problem: Problem, start: Values, **_: Any) -> Any:
        """Solve from `start`."""
        return self.solver.solve(problem, start)


PEERS = {
    "peer trf": Peer("trf"),
    "peer trf, jac": Peer("trf", "jac"),
    "peer dogbox": Peer("dogbox"),
    "peer dogbox, jac": Peer("dogbox", "jac"),
    "peer lm": Peer("lm"),
}
LEFT_OUT = ("nlopt-mlsl",)  # it needs bounds
AS_IT_COMES = f"{DEFAULT}, as it comes"
ALL: dict[str, Any] = {
    **{name: one for name, one in SOLVERS.items() if name not in LEFT_OUT},
    AS_IT_COMES: AsItComes(SOLVERS[DEFAULT]),
    **PEERS,
}
