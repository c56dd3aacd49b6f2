"""Rates of Gauss-Newton, Newton and steepest descent, and what line searches promise."""

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import TRUTH, decay, line, rosenbrock
from workbench import Block, GaussNewton, Newton, Problem, Residual, Status, SteepestDescent
from workbench.solvers import Solution, backtracking, columns, full_step, identity
from workbench.solvers.newton import reflected, shifted

START, NEAR = np.array([1.0, 3.0, 0.0]), np.array([1.5, 1.0, 0.3])


def errors(solution: Solution, minimum: np.ndarray) -> np.ndarray:
    return np.array([np.linalg.norm(i.values["x"] - minimum) for i in solution.trace])


def test_gauss_newton_converges_quadratically_when_the_residual_vanishes() -> None:
    problem, start = decay(noise=0.0)
    solution = GaussNewton(gradient_tolerance=0.0).solve(problem, start | {"x": START})
    e = errors(solution, TRUTH)
    tail = e[(e < 0.1) & (e > 1e-15)]
    assert len(tail) >= 4
    assert (tail[1:] <= tail[:-1] ** 2).all()  # the number of right digits doubles
    order = np.log(tail[-1] / tail[-2]) / np.log(tail[-2] / tail[-3])
    assert order > 1.7


def test_gauss_newton_converges_linearly_when_it_does_not() -> None:
    """By the spectral radius of I - (J'J)^-1 H: what J'J leaves out of H has its price."""
    problem, start = decay(noise=0.3)
    full = GaussNewton(line_search=full_step, gradient_tolerance=0.0, max_iterations=25)
    minimum = full.solve(problem, start | {"x": NEAR}).trace[-1].values["x"]
    here = problem.linearize(start | {"x": minimum})
    H = problem.hessian_at(*problem.split(start | {"x": minimum}))
    rate = np.abs(np.linalg.eigvals(np.eye(3) - np.linalg.solve(here.normal, H))).max()
    e = errors(full.solve(problem, start | {"x": NEAR}), minimum)
    tail = e[(e < 1e-4) & (e > 1e-9)]  # the slowest direction is left, and no rounding yet
    assert len(tail) >= 3
    np.testing.assert_allclose(tail[1:] / tail[:-1], rate, rtol=0.15)


def test_gauss_newton_meets_a_tolerance_of_zero_to_rounding() -> None:
    """The last steps gain less cost than rounding hides; they are judged by the gradient."""
    solution = GaussNewton(gradient_tolerance=0.0).solve(*decay())
    assert solution.optimality == 0
    assert solution.status is Status.CONVERGED
    costs = [iterate.cost for iterate in solution.trace]
    assert min(np.diff(costs)) < 0 <= max(np.diff(costs)) < 1e-14 * costs[-1]


def test_gauss_newton_solves_a_linear_problem_in_one_step() -> None:
    problem, start = line()
    for search in (backtracking, full_step):
        for far in (1.0, 1e-6, 1e6):
            solution = GaussNewton(line_search=search).solve(problem, {"x": far * start["x"]})
            assert solution.status is Status.CONVERGED
            assert solution.iterations == 1


def test_backtracking_keeps_armijos_condition() -> None:
    problem, start = rosenbrock()
    solution = GaussNewton().solve(problem, start)
    assert solution.converged
    shortened = 0
    for before, after in zip(solution.trace, solution.trace[1:], strict=False):
        here = problem.linearize(before.values)
        step = after.values["x"] - before.values["x"]
        slope = float(here.gradient @ step)
        assert slope < 0
        assert after.cost <= before.cost + 1e-4 * slope + 1e-15
        shortened += np.linalg.norm(step) < 0.9 * np.linalg.norm(here.step())
    assert shortened > 0  # else the promise was no constraint


# Newton: rates, and Hessians that are not positive definite.


@pytest.mark.parametrize("convexify", [shifted, reflected])
def test_newton_converges_quadratically_when_a_residual_is_left(convexify) -> None:
    """Where Gauss-Newton is linear (see above), the exact Hessian makes it quadratic."""
    problem, start = decay(noise=0.3)
    solver = Newton(convexify=convexify, gradient_tolerance=0.0)
    solution = solver.solve(problem, start | {"x": NEAR})
    e = errors(solution, solution.values["x"])
    tail = e[(e < 0.05) & (e > 1e-12)]
    assert len(tail) >= 3
    assert (tail[1:] < 20 * tail[:-1] ** 2).all()
    assert solution.trace[-1].damping == 0  # the Hessian there was left alone, and it says so


def test_newton_leaves_a_saddle() -> None:
    """1/2 (x^2 - 1)^2 + y^2/2: a saddle at 0, minima at x = -1 and 1."""
    x = Block("x", (2,)).symbol
    problem = Problem((Residual("saddle", cs.vertcat(x[0] ** 2 - 1, x[1]), 1.0),), ("x",))
    start = {"x": np.array([0.05, 0.5])}
    for convexify in (shifted, reflected):
        solution = Newton(convexify=convexify).solve(problem, start)
        assert solution.converged
        np.testing.assert_allclose(solution.values["x"], [1, 0], atol=1e-5)
        assert solution.trace[1].damping > 0
        assert solution.trace[-1].damping == 0
        assert (np.diff([i.cost for i in solution.trace]) < 0).all()


# Steepest descent.


def valley(condition: float) -> tuple[Problem, dict]:
    """A linear problem of given condition, in two unknowns, and the worst start (Akaike 1959)."""
    x = Block("x", (2,)).symbol
    s = cs.DM([1.0, np.sqrt(condition)])
    residual = Residual("valley", cs.vertcat(s * x, 0.0), 1.0)
    return Problem((residual,), ("x",)), {"x": np.array([condition, 1.0])}


@pytest.mark.parametrize("condition", [4.0, 25.0, 100.0])
def test_steepest_descent_falls_at_kantorovichs_rate(condition) -> None:
    problem, start = valley(condition)
    solver = SteepestDescent(scaling=identity, max_iterations=10)
    costs = np.array([i.cost for i in solver.solve(problem, start).trace])
    rate = ((condition - 1) / (condition + 1)) ** 2
    np.testing.assert_allclose(costs[1:] / costs[:-1], rate, rtol=1e-6)


def test_steepest_descent_is_short_when_columns_scale() -> None:
    problem, start = valley(1e6)
    assert SteepestDescent(scaling=columns).solve(problem, start).iterations == 1
    slow = SteepestDescent(scaling=identity, max_iterations=50).solve(problem, start)
    assert not slow.converged
