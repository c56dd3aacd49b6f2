"""Powell's dogleg, against a reference of its rules, and the path it is named after."""

import numpy as np
import pytest

from tests.solvers.problems import body_fit, decay, line, rosenbrock
from workbench import Dogleg, Linearization, Status
from workbench.solvers import chumpy, columns
from workbench.solvers.dogleg import cauchy_point, dogleg_step


def reference(problem, start, steps: int) -> list[np.ndarray]:
    """The points accepted by chumpy's rules, written down once more.

    The first radius is |Gauss-Newton step|; above a gain of 0.9 it becomes 2.5 |step| at least,
    below 0.05 a quarter; what lowers the cost is taken.
    """
    x, fixed = problem.split(start)
    points, delta = [x.copy()], None
    for _ in range(steps):
        here = problem.linearize_at(x, fixed)
        J, r = here.jacobian, here.residual
        g = J.T @ r
        d_gn = np.linalg.lstsq(J, -r, rcond=None)[0]
        d_sd = -(g @ g) / np.sum((J @ g) ** 2) * g
        if delta is None:
            delta = np.linalg.norm(d_gn)
        for _ in range(200):
            if np.linalg.norm(d_gn) <= delta:
                d = d_gn
            elif np.linalg.norm(d_sd) >= delta:
                d = d_sd * delta / np.linalg.norm(d_sd)
            else:
                leg = d_gn - d_sd
                beta = np.roots([leg @ leg, 2 * d_sd @ leg, d_sd @ d_sd - delta**2]).max()
                d = d_sd + beta * leg
            new = problem.residual(x + d, fixed)
            fall = r @ r - new @ new
            rho = fall / (r @ r - np.sum((r + J @ d) ** 2))
            if rho > 0.9:
                delta = max(delta, 2.5 * np.linalg.norm(d))
            elif rho < 0.05:
                delta *= 0.25
            if rho > 0:
                break
        x = x + d
        points.append(x.copy())
    return points


@pytest.mark.parametrize("build", [rosenbrock, decay, body_fit])
def test_the_iterates_are_those_of_the_courses_optimizer(build) -> None:
    problem, start = build()
    solution = Dogleg(rule=chumpy).solve(problem, start)
    assert solution.converged
    ours = [problem.free.pack(i.values) for i in solution.trace]
    assert len(ours) >= 6
    for mine, theirs in zip(ours, reference(problem, start, len(ours) - 1), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-9)


def test_the_path_is_down_the_slope_and_then_over() -> None:
    rng = np.random.default_rng(0)
    here, D = Linearization(rng.normal(size=9), rng.normal(size=(9, 4))), np.ones(4)
    newton, cauchy = here.step(), cauchy_point(here, D)
    full, short = np.linalg.norm(newton), np.linalg.norm(cauchy)
    assert short < full
    np.testing.assert_array_equal(dogleg_step(newton, cauchy, D, 2 * full), newton)
    np.testing.assert_allclose(dogleg_step(newton, cauchy, D, short / 2), cauchy / 2)
    costs = []
    for radius in np.linspace(0.1 * short, full, 30):
        step = dogleg_step(newton, cauchy, D, radius)
        assert np.linalg.norm(step) == pytest.approx(radius)
        costs.append(here.predicted_cost(step))
    assert (np.diff(costs) < 0).all()  # farther is better, all the way (Powell 1970)


def test_the_cauchy_point_is_the_least_along_the_gradient() -> None:
    rng = np.random.default_rng(1)
    here, D = Linearization(rng.normal(size=9), rng.normal(size=(9, 4))), rng.uniform(1, 2, 4)
    p = cauchy_point(here, D)
    np.testing.assert_allclose(
        p / np.linalg.norm(p) * np.linalg.norm(here.gradient / D**2), -here.gradient / D**2
    )
    for share in (0.99, 1.01):
        assert here.predicted_cost(share * p) > here.predicted_cost(p)


def test_the_cost_falls_with_every_iterate() -> None:
    for rule in (chumpy, Dogleg().rule):
        for start in ([-1.2, 1.0], [5.0, -7.0], [-30.0, 20.0]):
            problem, _ = rosenbrock()
            solution = Dogleg(rule=rule, max_iterations=1000).solve(problem, {"x": np.array(start)})
            assert solution.converged
            assert (np.diff([i.cost for i in solution.trace]) < 0).all()


def test_a_linear_problem_takes_one_step_from_any_start() -> None:
    problem, start = line()
    for rule in (chumpy, Dogleg().rule):
        for far in (1.0, 1e-6, 1e6):
            solution = Dogleg(rule=rule).solve(problem, {"x": far * start["x"]})
            assert solution.status is Status.CONVERGED
            assert solution.iterations == 1


def test_column_scaling_forgets_the_units() -> None:
    (problem, start), (other, other_start) = rosenbrock(), rosenbrock(1000.0)
    solver = Dogleg(scaling=columns, max_iterations=6)
    ours = [i.values["x"] for i in solver.solve(problem, start).trace]
    theirs = [i.values["x"] / [1, 1000.0] for i in solver.solve(other, other_start).trace]
    np.testing.assert_allclose(ours, theirs, rtol=1e-8)


def test_the_factorization_of_each_step_is_reported() -> None:
    solution = Dogleg().solve(*body_fit())
    assert set(solution.linear_algebra) <= {"cholesky", "qr", "svd"}
    assert sum(solution.linear_algebra.values()) == solution.iterations
