"""Damping: how it follows the gain, and what it does for IPOPT and SQP."""

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array

from workbench import Block, Constraint, Problem, Residual
from workbench.experiments import find
from workbench.problem.storage import dense
from workbench.solvers import Damped, Ipopt, Solver, Sqp, gauss_newton_hessian
from workbench.solvers.damping import RISE, eased
from workbench.solvers.run import Run


def test_a_gain_of_one_lowers_it_tenfold_and_of_one_half_keeps_it() -> None:
    assert eased(1.0) == pytest.approx(0.1)
    assert eased(0.5) == 1.0
    assert eased(1e-9) == pytest.approx(2.0)
    gains = np.linspace(0.01, 3, 50)
    assert (np.diff([eased(gain) for gain in gains]) <= 0).all()


def decay() -> tuple[Problem, dict[str, np.ndarray]]:
    x = Block("x", (2,)).symbol
    r = cs.vertcat(x[0] - 1, 10 * (x[1] - x[0] ** 2))
    return Problem([Residual("r", r, 1.0)], ["x"]), {"x": np.array([-1.2, 1.0])}


def test_it_rises_with_each_step_that_was_cut_and_falls_after_a_good_one() -> None:
    problem, start = decay()
    with Run("test", Ipopt(), problem, start, None) as run:
        hessian = Damped(1e-3).along(run)

        def damping(x: np.ndarray) -> float:
            here = run.linearize(x)
            raised = dense(hessian(x, np.zeros(0))) - dense(here.normal)
            assert raised[0, 0] == pytest.approx(raised[1, 1])
            assert raised[0, 1] == 0
            return float(raised[0, 0] / here.column_norms.max() ** 2)

        x = run.x
        assert damping(x) == pytest.approx(1e-3)
        assert damping(x) == pytest.approx(1e-3)  # asked again at the same point
        for share in (1.0, 0.5, 0.25):  # a line search, and its third trial is taken
            run.tried(x + share * np.array([0.1, 0.1]), np.inf)
        x = x + np.array([0.025, 0.025])
        assert damping(x) == pytest.approx(1e-3 * RISE**2)
        H = dense(hessian(x, np.zeros(0)))
        p = np.linalg.solve(H, -run.linearize(x).gradient)
        before, gradient = run.linearize(x).cost, run.linearize(x).gradient
        run.tried(x + p, before)
        gain = (before - run.linearize(x + p).cost) / (-gradient @ p - 0.5 * p @ H @ p)
        assert damping(x + p) == pytest.approx(1e-3 * RISE**2 * (eased(gain) if gain > 0 else 2.0))


def test_without_damping_it_is_the_hessian_of_gauss_and_newton() -> None:
    problem, start = decay()
    with Run("test", Ipopt(), problem, start, None) as run:
        found = dense(Damped(0.0).along(run)(run.x, np.zeros(0)))
        np.testing.assert_array_equal(found, gauss_newton_hessian(run, run.x, run.linearize(run.x)))


@pytest.mark.parametrize("solver", [Ipopt(), Sqp(), Ipopt(hessian=Damped(1e-2))])
def test_a_nearly_singular_fit_is_solved_by_damped_steps(solver: Solver) -> None:
    setup = find("body-points-lbs", {"start": 3}).setup()
    assert setup.known is not None
    found = solver.solve(setup.problem, setup.start)
    assert found.converged
    assert found.cost == pytest.approx(setup.known.cost, rel=1e-6)


@pytest.mark.parametrize("solver", [Ipopt, Sqp])
def test_undamped_the_line_search_cuts_each_step_of_it(solver: type[Ipopt] | type[Sqp]) -> None:
    setup = find("body-points-lbs", {"start": 3}).setup()
    assert setup.known is not None
    assert setup.known.cost is not None
    undamped = solver(hessian=gauss_newton_hessian, max_iterations=200)
    found = undamped.solve(setup.problem, setup.start)
    assert not found.converged
    assert found.cost > 1.1 * setup.known.cost
    assert found.evaluations.residual > 2 * found.evaluations.jacobian


def test_with_constraints_nothing_is_damped() -> None:
    """There, line searches cut steps for the constraints' sake, too."""
    x = Block("x", (2,)).symbol
    circle = Constraint("circle", cs.sumsqr(x), 1.0, 1.0)
    problem = Problem([Residual("r", x - cs.DM([2, 1]), 1.0)], ["x"], constraints=[circle])
    with Run("test", Ipopt(), problem, {"x": np.array([1.0, 0.0])}, None) as run:
        np.testing.assert_array_equal(Damped().along(run)(run.x, np.zeros(1)), np.eye(2))


def test_of_a_sparse_jacobian_it_is_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workbench.problem.storage.DENSE_FROM", 0)
    monkeypatch.setattr("workbench.problem.storage.SPARSE_UP_TO", 2.0)
    x = Block("x", (6,)).symbol
    problem = Problem([Residual("r", x**2 - 4, 1.0)], ["x"])
    with Run("test", Ipopt(), problem, {"x": np.full(6, 3.0)}, None) as run:
        H = Damped().along(run)(run.x, np.zeros(0))
        assert isinstance(H, csc_array)
        assert H.nnz == 6
    found = Ipopt().solve(problem, {"x": np.full(6, 3.0)})
    np.testing.assert_allclose(found.values["x"], 2, atol=1e-5)
