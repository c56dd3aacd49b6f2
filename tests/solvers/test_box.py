"""Levenberg-Marquardt between bounds: the right step, and no slower for it."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.optimize

from tests.solvers.problems import decay, rosenbrock
from workbench import Block, LevenbergMarquardt, Linearization, Problem, Residual, Status
from workbench.problem.steps import automatic
from workbench.solvers import columns
from workbench.solvers.box_step import box_step


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_the_step_is_the_best_one_inside(seed: int, damping: float) -> None:
    """As SciPy's active set method has it."""
    rng = np.random.default_rng(seed)
    m, n = 12, 6
    here = Linearization(rng.normal(size=m), rng.normal(size=(m, n)))
    low, high = -rng.uniform(0, 0.3, size=n), rng.uniform(0, 0.3, size=n)
    low[0] = high[0] = 0.0  # which is no room at all
    D = rng.uniform(0.5, 2, size=n)
    step = box_step(here, damping, D, low, high, automatic)
    assert step is not None
    A = np.concatenate([here.jacobian, np.sqrt(damping) * np.diag(D)])
    b = np.concatenate([-here.residual, np.zeros(n)])
    loose = low < high
    expected = scipy.optimize.lsq_linear(
        A[:, loose], b, (low[loose], high[loose]), method="bvls", tol=1e-14
    )
    np.testing.assert_allclose(step.p[loose], expected.x, atol=1e-9)
    assert step.p[0] == 0


def test_without_bounds_it_is_the_damped_step() -> None:
    rng = np.random.default_rng(0)
    here, D = Linearization(rng.normal(size=9), rng.normal(size=(9, 4))), np.ones(4)
    far = np.full(4, np.inf)
    step = box_step(here, 0.5, D, -far, far, automatic)
    assert step is not None
    np.testing.assert_array_equal(step.p, here.step(0.5))


def test_near_the_solution_bounds_cost_no_speed() -> None:
    """One entry at its bound; in the others the tail is quadratic, for there is no residual."""
    problem, start = decay(noise=0.0, bounds={"x": ([0.0, 1.3, 0.0], [5.0, 5.0, 5.0])})
    start = start | {"x": np.array([1.0, 1.3, 0.0])}
    solution = LevenbergMarquardt(gradient_tolerance=0.0, scaling=columns).solve(problem, start)
    assert solution.status is Status.CONVERGED
    errors = [np.linalg.norm(i.values["x"] - [2.0, 1.3, 0.5]) for i in solution.trace]
    tail = [e for e in errors if 1e-14 < e < 0.1]
    assert solution.iterations <= 12
    assert all(b < 0.2 * a for a, b in pairwise(tail))


@pytest.mark.parametrize("seed", range(5))
def test_a_minimum_in_a_corner_is_found_as_scipy_finds_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner = np.sort(rng.uniform(-1.5, 0.9, size=(2, 2)), axis=0)
    problem, _ = rosenbrock()
    problem = Problem(problem.residuals, ("x",), {"x": (corner[0], corner[1])})
    solution = LevenbergMarquardt().solve(problem, {"x": corner.mean(axis=0)})
    assert solution.converged
    x0, fixed = problem.split({"x": corner.mean(axis=0)})
    starts = [x0, corner[0] + 1e-6, corner[1] - 1e-6]
    best = min(
        scipy.optimize.least_squares(
            lambda x: problem.residual(x, fixed), x, bounds=(corner[0], corner[1]), xtol=1e-14
        ).cost
        for x in starts
    )
    assert solution.cost <= best * (1 + 1e-6) or solution.optimality < 1e-8


def test_equal_bounds_fix_an_entry() -> None:
    x = Block("x", (3,)).symbol
    problem = Problem((Residual("r", x - 1.0, 1.0),), ("x",), {"x": ([0.2, -9, -9], [0.2, 9, 9])})
    solution = LevenbergMarquardt().solve(problem, {"x": np.zeros(3)})
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [0.2, 1, 1], atol=1e-6)


def test_iterates_never_leave_the_box() -> None:
    problem, start = decay(bounds={"x": ([0.0, 0.0, 0.55], [1.9, 5.0, 5.0])})
    solution = LevenbergMarquardt().solve(problem, start | {"x": np.array([9.0, 9.0, 9.0])})
    for iterate in solution.trace:
        x = iterate.values["x"]
        assert (problem.lower <= x).all()
        assert (x <= problem.upper).all()
    assert (np.diff([i.cost for i in solution.trace]) < 0).all()
