"""Gauss-Newton's rate, and what its line search promises."""

import numpy as np

from tests.solvers.problems import TRUTH, decay, line, rosenbrock
from workbench import GaussNewton, Status
from workbench.solvers import Solution, backtracking, full_step

START, NEAR = np.array([1.0, 3.0, 0.0]), np.array([1.5, 1.0, 0.3])


def errors(solution: Solution, minimum: np.ndarray) -> np.ndarray:
    return np.array([np.linalg.norm(i.values["x"] - minimum) for i in solution.trace])


def test_convergence_is_quadratic_where_the_residual_vanishes() -> None:
    problem, start = decay(noise=0.0)
    solution = GaussNewton(gradient_tolerance=0.0).solve(problem, start | {"x": START})
    e = errors(solution, TRUTH)
    tail = e[(e < 0.1) & (e > 1e-15)]
    assert len(tail) >= 4
    assert (tail[1:] <= tail[:-1] ** 2).all()  # the number of right digits doubles
    order = np.log(tail[-1] / tail[-2]) / np.log(tail[-2] / tail[-3])
    assert order > 1.7


def test_convergence_is_linear_where_it_does_not() -> None:
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


def test_a_tolerance_of_zero_is_met_to_rounding() -> None:
    """The last steps gain less cost than rounding hides; they are judged by the gradient."""
    solution = GaussNewton(gradient_tolerance=0.0).solve(*decay())
    assert solution.optimality == 0
    assert solution.status is Status.CONVERGED
    costs = [iterate.cost for iterate in solution.trace]
    assert min(np.diff(costs)) < 0 <= max(np.diff(costs)) < 1e-14 * costs[-1]


def test_a_step_that_does_not_help_any_more_ends_the_run() -> None:
    problem, start = decay()
    around = GaussNewton(line_search=lambda run, x, here, p: 0.0, gradient_tolerance=0.0)
    assert around.solve(problem, start).status is Status.STALLED


def test_a_linear_problem_takes_one_step_from_any_start() -> None:
    problem, start = line()
    for search in (backtracking, full_step):
        for far in (1.0, 1e-6, 1e6):
            solution = GaussNewton(line_search=search).solve(problem, {"x": far * start["x"]})
            assert solution.status is Status.CONVERGED
            assert solution.iterations == 1


def test_every_step_keeps_armijos_promise() -> None:
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


def test_full_steps_may_climb() -> None:
    problem, start = rosenbrock()
    costs = [i.cost for i in GaussNewton(line_search=full_step).solve(problem, start).trace]
    assert costs[1] > costs[0]
    assert costs[-1] < 1e-20  # two steps, as it happens, through a cost a hundred times the first
