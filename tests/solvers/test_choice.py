"""Advice on solvers: what is seen of a problem, and what is recommended for it."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.solvers.problems import body_fit, rosenbrock
from workbench.errors import BadArgument, UnknownName
from workbench.solvers.choice import recommend


def line(n: int = 3, **rest: object) -> wb.Problem:
    """n numbers seen directly and, the first two, as a sum: linear, of full rank."""
    x = wb.Block("x", (n,))
    seen = wb.Residual("seen", x.symbol - 1.0, 1.0)
    both = wb.Residual("sum", x.symbol[0] + x.symbol[1], 1.0)
    return wb.Problem([seen, both], ["x"], blocks=[x], **rest)  # type: ignore[arg-type]


def test_recommendation_says_whether_steps_must_be_limited() -> None:
    straight = recommend(line(), {"x": np.zeros(3)})
    assert straight.solver == "trust-region"
    assert "gauss-newton works as well" in str(straight)
    curved = recommend(*rosenbrock())
    assert "gain ratio of a Gauss-Newton step: -" in str(curved)
    assert "steps must be limited" in str(curved)
    assert "gauss-newton" not in str(curved)


def test_recommendation_takes_bounds_as_the_solver_does() -> None:
    """The default looks for the best step inside; it projects nothing."""
    advice = recommend(line(bounds={"x": (-np.inf, 0.5)}), {"x": np.zeros(3)})
    assert "3 unknowns are bounded" in str(advice)
    assert wb.SOLVERS[advice.solver].abilities.bounds.name == "TAKEN"
    assert "the best ones inside the bounds" in str(advice)
    assert "project" not in str(advice)


def test_recommendation_evaluates_only_inside_the_bounds() -> None:
    x = wb.Block("x")
    root = wb.Residual("root", cs.sqrt(x.symbol) - 0.2, 1.0)
    advice = recommend(wb.Problem([root], ["x"], {"x": (0.01, 1.0)}, [x]), {"x": np.array(4.0)})
    assert "gain ratio of a Gauss-Newton step: 1.15" in str(advice)


def test_recommended_solver_takes_constraints() -> None:
    x = wb.Block("x", (3,))
    seen = wb.Residual("seen", x.symbol - 1.0, 1.0)
    circle = wb.Constraint("circle", cs.sumsqr(x.symbol), 1.0, 1.0)
    half = wb.Constraint("half", x.symbol[0], 0.0)
    problem = wb.Problem([seen], ["x"], blocks=[x], constraints=[circle, half])
    advice = recommend(problem, {"x": np.array([0.5, 0.1, 0.1])})
    solution = wb.solve(problem, {"x": np.array([0.5, 0.1, 0.1])}, advice.solver)
    np.testing.assert_allclose(solution.values["x"], 1 / np.sqrt(3), atol=1e-5)


def test_recommendation_mentions_directions_that_nothing_sees() -> None:
    x = wb.Block("x", (3,))
    problem = wb.Problem([wb.Residual("sum", cs.sum1(x.symbol), 1.0)], ["x"], blocks=[x])
    advice = recommend(problem, {"x": np.ones(3)})
    assert "2 directions are undetermined" in str(advice)
    assert "workbench diagnose" in str(advice)


def test_a_problem_too_large_for_its_rank_is_given_a_solver() -> None:
    """5,000 unknowns of a chain: the Jacobian is sparse, and its singular values are refused."""
    x = wb.Block("x", (5_000,))
    steps = wb.Residual("steps", x.symbol[1:] - x.symbol[:-1] - 1.0, 1.0)
    problem = wb.Problem([steps, wb.Residual("seen", x.symbol, 1.0)], ["x"], blocks=[x])
    advice = recommend(problem, {"x": np.zeros(5_000)})
    assert advice.solver == "trust-region"
    assert "too large to compute its rank" in str(advice)


def test_a_problem_without_unknowns_needs_no_solver() -> None:
    x = wb.Block("x", (2,))
    problem = wb.Problem([wb.Residual("seen", x.symbol, 1.0)], [], blocks=[x])
    with pytest.raises(BadArgument, match="the problem has no unknowns; leave a block free"):
        recommend(problem, {"x": np.zeros(2)})


def test_solvers_are_taken_by_the_names_of_the_commands() -> None:
    problem, start = body_fit()
    for name in ("ipopt", "levenberg-marquardt-columns"):
        by_name, by_object = (wb.solve(problem, start, s) for s in (name, wb.SOLVERS[name]))
        assert by_name.cost == by_object.cost
        assert by_name.solver == by_object.solver
    with pytest.raises(UnknownName, match=r"no solver is called 'ipot'; there are .*ipopt, ipopt-"):
        wb.solve(problem, start, "ipot")
