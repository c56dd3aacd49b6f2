"""Levenberg-Marquardt's descent, and what its scaling means."""

from itertools import pairwise

import casadi as cs
import numpy as np
import pytest
import scipy.optimize

import workbench as wb
from tests.solvers.problems import decay, line, rosenbrock
from tests.tiers import few
from workbench import Block, LevenbergMarquardt, Linearization, Problem, Residual, Status
from workbench.errors import BadArgument
from workbench.problem import steps
from workbench.problem.steps import automatic
from workbench.solvers import columns, identity
from workbench.solvers.trust_region import box_step

FAR = [{"x": np.array(x)} for x in ([-1.2, 1.0], [5.0, -7.0], [-30.0, 20.0])]


@pytest.mark.parametrize("scaling", [identity, columns])
@pytest.mark.parametrize("start", FAR, ids=lambda start: str(start["x"]))
def test_the_cost_falls_with_every_iterate(scaling, start) -> None:
    problem, _ = rosenbrock()
    solution = LevenbergMarquardt(scaling=scaling, max_iterations=1000).solve(problem, start)
    costs = [iterate.cost for iterate in solution.trace]
    assert (np.diff(costs) < 0).all()
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [1, 1], atol=1e-5)


def test_each_step_is_the_damped_one() -> None:
    problem, start = decay()
    solution = LevenbergMarquardt().solve(problem, start)
    first, second = solution.trace[:2]
    here = problem.linearize(start)
    fraction = LevenbergMarquardt().first_damping
    assert first.damping == pytest.approx(fraction * here.column_norms.max() ** 2)
    dampings = first.damping * np.cumprod([1, 2, 4, 8])  # Nielsen's, for steps that were refused
    steps = [here.step(damping) for damping in dampings]
    taken = second.values["x"] - first.values["x"]
    assert min(np.linalg.norm(step - taken) for step in steps) < 1e-12


def test_good_steps_lower_the_damping() -> None:
    dampings = [i.damping for i in LevenbergMarquardt().solve(*line()).trace]
    factors = np.divide(dampings[1:], dampings[:-1])
    assert (factors < 0.5).all()
    np.testing.assert_allclose(factors, factors[0])  # every gain is 1: as fast as it may fall


def test_column_scaling_forgets_the_units() -> None:
    """With D = |J_i| the iterates are the same in any unit; with D = 1 they are not."""
    scale = 1000.0
    for scaling, alike in ((columns, True), (identity, False)):
        (problem, start), (other, other_start) = rosenbrock(), rosenbrock(scale)
        solver = LevenbergMarquardt(scaling=scaling, max_iterations=5)
        ours = [i.values["x"] for i in solver.solve(problem, start).trace]
        theirs = [i.values["x"] / [1, scale] for i in solver.solve(other, other_start).trace]
        same = len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=1e-8)
        assert same is alike


def test_scalings_are_what_they_say() -> None:
    here = Linearization(np.ones(2), np.array([[3.0, 0.0, 1.0], [4.0, 0.0, 0.0]]))
    np.testing.assert_array_equal(identity(here), [1, 1, 1])
    np.testing.assert_array_equal(columns(here), [5, 1, 1])  # what nothing sees stays put


def bdqrtic(n: int) -> tuple[Problem, dict[str, np.ndarray]]:
    """Of Moré and Wild (SIAM J. Optim. 20, 2009): columns that vanish where x does."""
    x = Block("x", (n,)).symbol
    rows = [3 - 4 * x[i] for i in range(n - 4)]
    rows += [
        x[i] ** 2 + 2 * x[i + 1] ** 2 + 3 * x[i + 2] ** 2 + 4 * x[i + 3] ** 2 + 5 * x[n - 1] ** 2
        for i in range(n - 4)
    ]
    return Problem((Residual("bdqrtic", cs.vertcat(*rows), 1.0),), ("x",)), {"x": np.ones(n)}


@pytest.mark.parametrize("n", few([8, 12], 1))
def test_vanishing_columns_keep_their_scaling(n: int) -> None:
    """With D = |J_i| of each iterate alone it runs aground at several times the least cost."""
    problem, start = bdqrtic(n)
    x, fixed = problem.split(start)
    expected = scipy.optimize.least_squares(
        lambda x: problem.residual(x, fixed),
        x,
        jac=lambda x: problem.linearize_at(x, fixed).jacobian,
        xtol=1e-14,
        ftol=1e-14,
    )
    solution = LevenbergMarquardt(scaling=columns).solve(problem, start)
    assert solution.cost == pytest.approx(expected.cost, rel=1e-8)


@pytest.mark.parametrize("by", [steps.qr, steps.svd, steps.cholesky])
def test_the_linear_algebra_is_a_value(by) -> None:
    """Whoever it is, the way is the same; what Cholesky declines is damped until it does not."""
    problem, start = decay()
    solution = LevenbergMarquardt(linear_algebra=by).solve(problem, start)
    assert solution.converged
    assert set(solution.linear_algebra) == {by.__name__}
    x = Block("x", (2,)).symbol
    blind = Problem((Residual("sum", x[0] + x[1] - 1.0, 1.0),), ("x",))
    solution = LevenbergMarquardt(linear_algebra=by).solve(blind, {"x": np.zeros(2)})
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [0.5, 0.5], atol=1e-6)


# Several steps with each Jacobian.

ROOT = np.array([0.5, -0.3])


def equations() -> Problem:
    """Two equations in two unknowns, solved by `ROOT`."""
    x = Block("x", (2,)).symbol
    left = cs.vertcat(cs.exp(x[0]) + x[1] ** 2 + x[0] * x[1], x[0] + cs.sin(x[1]) + x[0] ** 3)
    right = cs.Function("right", [x], [left])(ROOT)
    return Problem((Residual("equations", left - right, 1.0),), ("x",))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_steps_with_one_jacobian_raise_the_order_by_one_each(count: int) -> None:
    """From half as far, all of them together end 2^(m + 1) times as near (Shamanskii 1967)."""
    solver = LevenbergMarquardt(steps_per_jacobian=count, first_damping=1e-15, max_iterations=1)
    away = [
        np.linalg.norm(solver.solve(equations(), {"x": ROOT + offset}).trace[1].values["x"] - ROOT)
        for offset in (np.array([0.02, 0.01]), np.array([0.01, 0.005]))
    ]
    assert np.log2(away[0] / away[1]) == pytest.approx(count + 1, abs=0.1)


@pytest.mark.thorough
def test_two_steps_with_each_jacobian_need_fewer_jacobians() -> None:
    body = wb.load_body("small")
    pose = 0.15 * np.random.default_rng(0).normal(size=(24, 3))
    seen = body.vertices(pose, np.ones(10), np.zeros(3))
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = Problem([wb.residuals.vertices(points, seen, sigma=0.01)], ("pose", "betas", "trans"))
    plain, two = (
        LevenbergMarquardt(steps_per_jacobian=count).solve(problem, body.start())
        for count in (1, 2)
    )
    assert plain.converged
    assert two.converged
    assert two.evaluations.jacobian <= plain.evaluations.jacobian - 2
    assert (np.diff([iterate.cost for iterate in two.trace]) < 0).all()


@pytest.mark.parametrize("start", FAR, ids=lambda start: str(start["x"]))
def test_the_first_of_two_steps_is_tried_alone(start) -> None:
    problem, _ = rosenbrock()
    plain, two = (
        LevenbergMarquardt(steps_per_jacobian=count).solve(problem, start) for count in (1, 2)
    )
    assert two.converged
    assert two.evaluations.jacobian < plain.evaluations.jacobian
    assert (np.diff([iterate.cost for iterate in two.trace]) < 0).all()
    np.testing.assert_allclose(two.values["x"], [1, 1], atol=1e-5)


@pytest.mark.parametrize("by", [steps.automatic, steps.qr])
def test_further_steps_stay_between_bounds(by) -> None:
    problem, start = decay(bounds={"x": ([0.0, 0.0, 0.6], [1.8, 5.0, 5.0])})
    plain = LevenbergMarquardt().solve(problem, start)
    two = LevenbergMarquardt(steps_per_jacobian=2, linear_algebra=by).solve(problem, start)
    assert two.converged
    np.testing.assert_allclose(two.values["x"], plain.values["x"], atol=1e-6)
    for iterate in two.trace:
        x = np.asarray(iterate.values["x"])
        assert ((problem.lower <= x) & (x <= problem.upper)).all()
    assert two.values["x"][2] == 0.6


def test_there_is_a_step_with_each_jacobian() -> None:
    with pytest.raises(BadArgument, match="`steps_per_jacobian` must be 1, for the plain method"):
        LevenbergMarquardt(steps_per_jacobian=0)


# Between bounds.


@pytest.mark.parametrize("damping", [0.0, 0.1, 10.0])
def test_the_step_is_the_best_one_inside(damping: float) -> None:
    """As SciPy's active set method has it."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        m, n = 12, 6
        here = Linearization(rng.normal(size=m), rng.normal(size=(m, n)))
        low, high = -rng.uniform(0, 0.3, size=n), rng.uniform(0, 0.3, size=n)
        low[0] = high[0] = 0.0  # which is no room at all
        D = rng.uniform(0.3, 3, size=n)
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


@pytest.mark.parametrize("seed", few(range(5), 2))
def test_minima_in_corners_are_those_of_scipy(seed: int) -> None:
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
