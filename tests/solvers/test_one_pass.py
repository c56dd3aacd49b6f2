"""Trials that will be taken are linearized at once: the same way, with fewer evaluations."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.compilers import NEEDS_A_COMPILER
from workbench.problem import gram, linearization, storage
from workbench.residuals import Residual
from workbench.solvers import no_minimum
from workbench.solvers.damping import DAMPED
from workbench.solvers.one_pass import LARGEST, OnePass, takes_one_pass

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


@NEEDS_A_COMPILER
@pytest.mark.usefixtures("of_any_size")
@pytest.mark.parametrize("solver", [*SOLVERS, wb.Ipopt()], ids=lambda one: type(one).__name__)
def test_no_bit_of_the_way_depends_on_whether_trials_are_linearized_at_once(
    solver: wb.solvers.Solver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """IPOPT's damping follows the number of trials, and the judgement that of evaluations."""
    problem, start = problem_of(valley), {"x": np.array([-1.2, 1.0])}
    looked_at: list[int] = []
    most = no_minimum.most_gradients

    def noted(n: int, evaluations: int) -> int:
        looked_at.append(evaluations)
        return most(n, evaluations)

    monkeypatch.setattr(no_minimum, "most_gradients", noted)
    at_once = wb.solve(problem, start, solver)
    monkeypatch.setattr(OnePass, "expected", lambda self: False)
    apart = wb.solve(problem, start, solver)
    assert looked_at == [apart.evaluations.total] * 2
    assert at_once.status is apart.status
    assert len(at_once.trace) == len(apart.trace)
    for one, other in zip(at_once.trace, apart.trace, strict=True):
        np.testing.assert_array_equal(one.values["x"], other.values["x"])
        assert one.damping == other.damping
    assert at_once.judging == apart.judging
    assert at_once.evaluations.residual < apart.evaluations.residual / 2
    assert at_once.evaluations.total < apart.evaluations.total


def test_after_a_refused_trial_the_next_is_not_linearized_at_once() -> None:
    one_pass = OnePass(on=True)
    assert one_pass.expected()  # the first one
    one_pass.judged(taken=False)
    assert not one_pass.expected()
    assert (one_pass.at_once, one_pass.saved) == (1, 0)
    one_pass.judged(taken=True)
    assert one_pass.expected()
    one_pass.judged(taken=True)
    assert (one_pass.at_once, one_pass.saved) == (2, 1)
    off = OnePass(on=False)
    off.judged(taken=True)
    assert not off.expected()


def test_after_a_line_search_that_took_another_than_its_first_trial_neither() -> None:
    one_pass = OnePass(on=True)
    assert one_pass.expected()
    assert not one_pass.expected()  # nobody has taken the first
    one_pass.judged(taken=True)
    assert not one_pass.expected()
    one_pass.judged(taken=True)  # this time it was the first
    assert one_pass.expected()
    assert (one_pass.at_once, one_pass.saved) == (2, 0)


@NEEDS_A_COMPILER
@pytest.mark.usefixtures("of_any_size")
def test_between_bounds_ipopt_linearizes_no_trial_at_once() -> None:
    """On its way between bounds the cost may rise, and Jacobians would be computed in vain."""
    x = wb.Block("x", (2,), "1")
    terms = [Residual("r", valley(x.symbol), sigma=1.0)]
    problem = wb.Problem(terms, free=("x",), bounds={"x": (-2.0, 0.5)})
    found = wb.solve(problem, {"x": np.array([-1.2, 0.4])}, wb.Ipopt(DAMPED))
    assert found.evaluations.residual >= found.evaluations.jacobian - 1 > 3


@NEEDS_A_COMPILER
@pytest.mark.usefixtures("of_any_size")
def test_a_trial_that_costs_more_gets_no_normal_equations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[float] = []
    products = linearization.normal_equations

    def counted(J: object, r: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        made.append(0.5 * float(r @ r))
        return products(J, r)

    monkeypatch.setattr(linearization, "normal_equations", counted)
    found = wb.solve(problem_of(valley), {"x": np.array([-1.2, 1.0])}, SOLVERS[0])
    assert found.evaluations.jacobian > len(found.trace)  # some trials were refused
    assert made == [one.cost for one in found.trace]


@NEEDS_A_COMPILER
@pytest.mark.parametrize("of_first_order", [True, False])
def test_hessians_of_first_order_come_with_the_jacobian(
    of_first_order: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that neither the gradient nor the lengths of columns are computed on their own."""
    body = wb.load_body("default")
    seen = body.vertices(0.05 * np.ones((24, 3)), np.ones(10), np.zeros(3)) + 0.001
    points = body.points(*(block.symbol for block in body.blocks()))
    terms = [wb.residuals.vertices(points, seen, sigma=0.01)]
    problem = wb.Problem(terms, free=("betas", "trans", "pose"))
    apart: list[object] = []
    lengths = storage.column_norms

    def measured(matrix: object, normal: object = None) -> np.ndarray:
        apart.extend([matrix] * (normal is None))
        return lengths(matrix, normal)  # type: ignore[arg-type]

    monkeypatch.setattr(storage, "column_norms", measured)
    hessian = DAMPED if of_first_order else None
    wb.solve(problem, body.start(), wb.Ipopt(hessian, max_iterations=3))
    assert bool(apart) is not of_first_order
