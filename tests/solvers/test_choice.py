"""Advice on solvers: what is seen of a problem, and what is recommended for it."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.solvers.problems import body_fit, rosenbrock
from workbench.solvers.choice import recommend, temperament


def line(n: int = 3, **rest: object) -> wb.Problem:
    """n numbers seen directly and, the first two, as a sum: linear, of full rank."""
    x = wb.Block("x", (n,))
    seen = wb.Residual("seen", x.symbol - 1.0, 1.0)
    both = wb.Residual("sum", x.symbol[0] + x.symbol[1], 1.0)
    return wb.Problem([seen, both], ["x"], blocks=[x], **rest)  # type: ignore[arg-type]


def test_what_is_seen_of_a_linear_problem_is_exact() -> None:
    seen = temperament(line(), {"x": np.zeros(3)})
    assert (seen.unknowns, seen.residuals, seen.rank) == (3, 4, 3)
    assert seen.density == 5 / 12
    assert seen.gain_ratio == pytest.approx(1.0, abs=1e-12)
    unit = np.array([[1, 0, 0], [0, 1, 0], [0, 0, np.sqrt(2)], [1, 1, 0]]) / np.sqrt(2)
    assert seen.condition == pytest.approx(np.linalg.cond(unit), rel=1e-12)


def test_a_linear_problem_needs_no_damping() -> None:
    advice = recommend(line(), {"x": np.zeros(3)})
    assert advice.solver == "trust-region"
    assert "gauss-newton" in advice.others


def test_a_curved_valley_needs_limited_steps() -> None:
    problem, start = rosenbrock()
    advice = recommend(problem, start)
    assert advice.temperament.gain_ratio < 0
    assert "gauss-newton" not in advice.others
    assert any("must be limited" in reason for reason in advice.reasons)


def test_bounds_leave_out_who_takes_none() -> None:
    problem = line(bounds={"x": (-np.inf, 0.5)})
    advice = recommend(problem, {"x": np.zeros(3)})
    assert advice.temperament.bounded == 3
    able = {wb.SOLVERS[name].abilities.bounds.name for name in (advice.solver, *advice.others)}
    assert able == {"TAKEN"}


def test_constraints_ask_for_those_who_take_them() -> None:
    x = wb.Block("x", (3,))
    seen = wb.Residual("seen", x.symbol - 1.0, 1.0)
    circle = wb.Constraint("circle", cs.sumsqr(x.symbol), 1.0, 1.0)
    half = wb.Constraint("half", x.symbol[0], 0.0)
    problem = wb.Problem([seen], ["x"], blocks=[x], constraints=[circle, half])
    advice = recommend(problem, {"x": np.array([0.5, 0.1, 0.1])})
    assert (advice.temperament.equations, advice.temperament.inequalities) == (1, 1)
    for name in (advice.solver, *advice.others):
        found = wb.solve(problem, {"x": np.array([0.5, 0.1, 0.1])}, wb.SOLVERS[name])
        np.testing.assert_allclose(found.values["x"], 1 / np.sqrt(3), atol=1e-5)


def test_directions_that_nothing_sees_are_mentioned() -> None:
    x = wb.Block("x", (3,))
    problem = wb.Problem([wb.Residual("sum", cs.sum1(x.symbol), 1.0)], ["x"], blocks=[x])
    advice = recommend(problem, {"x": np.ones(3)})
    assert advice.temperament.rank == 1
    assert "2 directions are undetermined" in str(advice)
    assert any("workbench diagnose" in reason for reason in advice.reasons)


def test_recommended_solvers_fit_a_body() -> None:
    problem, start = body_fit()[:2]
    advice = recommend(problem, start)
    costs = [
        wb.solve(problem, start, wb.SOLVERS[name]).cost for name in (advice.solver, *advice.others)
    ]
    assert max(costs) <= min(costs) + 1e-6 * (1 + min(costs))
