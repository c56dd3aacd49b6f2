"""Newton's rate, and what is done where the Hessian is not positive definite."""

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import decay
from workbench import SOLVERS, Block, Newton, Problem, Residual, SteepestDescent
from workbench.solvers import columns, identity
from workbench.solvers.convexity import reflected, shifted


@pytest.mark.parametrize("convexify", [shifted, reflected])
def test_convergence_is_quadratic_even_with_a_residual(convexify) -> None:
    """Where Gauss-Newton is linear (test_gauss_newton), the exact Hessian makes it quadratic."""
    problem, start = decay(noise=0.3)
    solver = Newton(convexify=convexify, gradient_tolerance=0.0)
    solution = solver.solve(problem, start | {"x": np.array([1.5, 1.0, 0.3])})
    minimum = solution.values["x"]
    e = np.array([np.linalg.norm(i.values["x"] - minimum) for i in solution.trace])
    tail = e[(e < 0.05) & (e > 1e-12)]
    assert len(tail) >= 3
    assert (tail[1:] < 20 * tail[:-1] ** 2).all()
    assert solution.trace[-1].damping == 0  # the Hessian there was left alone, and it says so


@pytest.mark.parametrize("convexify", [shifted, reflected])
def test_a_matrix_is_made_positive_definite_and_no_more(convexify) -> None:
    rng = np.random.default_rng(0)
    Q = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    good = Q @ np.diag([1.0, 2, 3, 4]) @ Q.T
    assert convexify(good).change == 0
    np.testing.assert_array_equal(convexify(good).matrix, good)
    bad = Q @ np.diag([-2.0, 0.0, 3, 4]) @ Q.T
    matrix, change = convexify(bad)
    values = np.linalg.eigvalsh(matrix)
    assert values.min() > 0
    if convexify is reflected:
        np.testing.assert_allclose(values, [4e-8, 2, 3, 4], atol=1e-12)
        assert change == pytest.approx(4)
    else:
        np.testing.assert_allclose(values - change, [-2, 0, 3, 4], atol=1e-12)
        assert change == pytest.approx(2, rel=1e-6)


def saddle() -> tuple[Problem, dict]:
    """1/2 (x^2 - 1)^2 + y^2/2: a saddle at 0, minima at x = -1 and 1."""
    x = Block("x", (2,)).symbol
    return Problem((Residual("saddle", cs.vertcat(x[0] ** 2 - 1, x[1]), 1.0),), ("x",)), {
        "x": np.array([0.05, 0.5])
    }


def test_it_leaves_a_saddle_and_says_that_it_had_to() -> None:
    problem, start = saddle()
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
def test_the_cost_falls_as_kantorovich_says_and_no_faster_from_the_worst_start(condition) -> None:
    problem, start = valley(condition)
    solver = SteepestDescent(scaling=identity, max_iterations=10)
    costs = np.array([i.cost for i in solver.solve(problem, start).trace])
    rate = ((condition - 1) / (condition + 1)) ** 2
    np.testing.assert_allclose(costs[1:] / costs[:-1], rate, rtol=1e-6)


def test_a_good_metric_makes_it_short() -> None:
    problem, start = valley(1e6)
    assert SteepestDescent(scaling=columns).solve(problem, start).iterations == 1
    slow = SteepestDescent(scaling=identity, max_iterations=50).solve(problem, start)
    assert not slow.converged
    assert SOLVERS["steepest-descent"].abilities.teaching
