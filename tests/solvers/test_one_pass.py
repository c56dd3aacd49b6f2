"""Trials that will be taken are linearized at once: the same way, with fewer evaluations."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.compilers import NEEDS_A_COMPILER
from workbench.problem import gram
from workbench.residuals import Residual
from workbench.solvers.one_pass import LARGEST, takes_one_pass

SOLVERS = (wb.LevenbergMarquardt(), wb.solvers.TrustRegion())


def valley(x: cs.MX) -> cs.MX:
    """Rosenbrock's, along which steps are refused now and then."""
    return cs.vertcat(10 * (x[1] - x[0] ** 2), 1 - x[0])


def edge(x: cs.MX) -> cs.MX:
    """Not a number beyond x_0 = 0, where steps along the tangent lead; the minimum is inside."""
    return cs.vertcat(cs.log(x[0]) - 4, x[1] - cs.sqrt(x[0]), cs.log(x[0]) + 4)


def problem_of(function: Callable[[cs.MX], cs.MX]) -> wb.Problem:
    x = wb.Block("x", (2,), "1")
    return wb.Problem([Residual("r", function(x.symbol), sigma=1.0)], free=("x",))


@pytest.fixture
def of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gram, "MANY", 0.0)


@NEEDS_A_COMPILER
@pytest.mark.usefixtures("of_any_size")
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize(
    ("function", "start"), [(valley, (-1.2, 1.0)), (edge, (30.0, 0.0))], ids=["valley", "edge"]
)
def test_the_way_is_the_same(
    solver: wb.solvers.Solver,
    function: Callable[[cs.MX], cs.MX],
    start: tuple[float, float],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = problem_of(function)
    assert takes_one_pass(solver, problem)
    at_once = wb.solve(problem, {"x": np.array(start)}, solver)
    monkeypatch.setattr(gram, "compiled", lambda: None)
    assert not takes_one_pass(solver, problem)
    apart = wb.solve(problem, {"x": np.array(start)}, solver)
    assert at_once.status is apart.status
    assert len(at_once.trace) == len(apart.trace)
    for one, other in zip(at_once.trace, apart.trace, strict=True):
        np.testing.assert_allclose(one.values["x"], other.values["x"], rtol=1e-7, atol=1e-9)
    assert at_once.evaluations.residual < apart.evaluations.residual


@pytest.mark.thorough
@NEEDS_A_COMPILER
def test_a_fit_of_a_surface_needs_no_residual_alone() -> None:
    body = wb.load_body("default")
    seen = body.vertices(0.05 * np.ones((24, 3)), np.ones(10), np.zeros(3))
    points = body.points(*(block.symbol for block in body.blocks()))
    terms = [wb.residuals.vertices(points, seen, sigma=0.01)]
    problem = wb.Problem(terms, free=("pose", "betas", "trans"))
    assert takes_one_pass(SOLVERS[0], problem)
    assert not takes_one_pass(wb.Ipopt(), problem)  # which takes its steps itself
    found = wb.solve(problem, body.start(), SOLVERS[0])
    assert found.cost < 1e-12
    assert found.evaluations.residual == 0  # every trial was taken
    assert found.evaluations.jacobian == len(found.trace)
    assert 8 * problem.size * problem.free.size < LARGEST
