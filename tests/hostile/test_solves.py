"""Solvers on problems with numbers that are too large, too small, or none at all.

Each ends with a status, keeps the best point, and lets no warning out: the suite turns warnings
into errors.
"""

from dataclasses import replace
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.tiers import few
from workbench.errors import NotSupported
from workbench.solvers import Status

X, Y = cs.MX.sym("x", 2), cs.MX.sym("x", 1)
A, B = X[0], X[1]
LINE = cs.vertcat(A - 1, B - 2)
BIG = 1e308


def at(expression: cs.MX, *start: float, sigma: float = 1.0, **more: Any) -> tuple[Any, ...]:
    return expression, np.array(start), sigma, more


def under(expression: cs.MX, lower: float, upper: float) -> dict[str, object]:
    return {"constraints": [wb.Constraint("c", expression, lower=lower, upper=upper)]}


HOSTILE: dict[str, tuple[Any, ...]] = {
    "a start without numbers": at(cs.vertcat(cs.sqrt(A) - 2, B), -1, 3),
    "a logarithm of next to nothing": at(cs.vertcat(cs.log(A), B - 1), 1e-300, 3),
    "an exponential whose square overflows": at(cs.vertcat(cs.exp(A) - 1, B - 1), 354, 3),
    "residuals of 1e300": at(1e300 * LINE, 3, 3),
    "a start at 1e300": at(LINE, 1e300, -1e300),
    "one unknown with an infinite slope": at(cs.sqrt(cs.fabs(Y)), 0),
    "bounds farther apart than numbers go": at(
        LINE, 3, 3, bounds={"x": ([-BIG, -BIG], [BIG, BIG])}
    ),
    "a division by zero": at(cs.vertcat(1 / A - 1, B), 0, 1),
    "a cliff of NaN": at(cs.vertcat(cs.if_else(A > 0.5, A, np.nan), B), 1, 3),
    "a constraint that overflows": at(LINE, 709, -1, **under(cs.exp(A), 0.0, 1.0)),
    # Of these, only the default solver is asked.
    "an exponential below overflow": at(cs.vertcat(cs.exp(A), B - 1), 700, 3),
    "a start whose square overflows": at(cs.vertcat(A**2 - 1, B - 2), 1e160, -1e150),
    "a column of zeros": at(A - 1 + 0 * B, 3, 3),
    "a lower bound that is the upper one": at(LINE, 3, 3, bounds={"x": ([3, 0], [3, 5])}),
    "rows 1e400 apart": at(cs.vertcat(1e200 * (A - 1), 1e-200 * (B - 2)), 3, 3),
    "a sigma of 1e-300": at(LINE, 3, 3, sigma=1e-300),
    "a cliff of infinity": at(cs.vertcat(cs.if_else(A > 0, A, cs.inf), B), 1, 3),
    "a constraint without numbers": at(LINE, 3, -1, **under(cs.sqrt(A) * cs.sqrt(B), 1.0, 1.0)),
}
ASKED = ("trust-region", "levenberg-marquardt", "ipopt", "gauss-newton", "dogleg", "newton", "sqp")


def problem_of(name: str) -> tuple[wb.Problem, np.ndarray]:
    expression, start, sigma, more = HOSTILE[name]
    return wb.Problem([wb.Residual("r", expression, sigma)], ["x"], **more), start


@pytest.mark.parametrize("solver", few([*ASKED, "scipy-trf", "nlopt-lbfgs", "nlopt-bobyqa"], 1))
def test_hostile_problems_end_no_worse_than_they_began(solver: str) -> None:
    for name in HOSTILE if solver == ASKED[0] else list(HOSTILE)[:12]:
        problem, start = problem_of(name)
        limited = replace(wb.SOLVERS[solver], max_seconds=2.0)  # type: ignore[type-var]
        try:
            found = wb.solve(problem, {"x": start}, limited)
        except NotSupported:
            continue
        assert isinstance(found.status, Status), name
        assert found.message, name
        inside = np.clip(start, problem.lower, problem.upper)
        first = problem.residual(*problem.split({"x": inside}))
        with np.errstate(over="ignore"):
            cost = 0.5 * float(first @ first)
        differentiable = problem.linearize({"x": start}).finite  # else it is no point to begin at
        if np.isfinite(cost) and differentiable and not problem.constraints:
            assert found.cost <= cost, name
        if found.status is Status.CONVERGED:
            assert np.isfinite(found.cost), name
