"""Levenberg-Marquardt and the dogleg: their steps, damping and radii, and what scaling means."""

from itertools import pairwise

import casadi as cs
import numpy as np
import pytest
import scipy.optimize

from tests.solvers.problems import body_fit, decay, line, rosenbrock
from workbench import (
    Block,
    Dogleg,
    GaussNewton,
    LevenbergMarquardt,
    Linearization,
    Problem,
    Residual,
    Solver,
    Status,
    Values,
)
from workbench.problem.steps import automatic
from workbench.solvers import Ipopt, Sqp, chumpy, columns, identity
from workbench.solvers.dogleg import FIRST_SHARE, cauchy_point, dogleg_step
from workbench.solvers.trust_region import box_step

FAR = [{"x": np.array(x)} for x in ([-1.2, 1.0], [5.0, -7.0], [-30.0, 20.0])]
FROM_FAR = pytest.mark.parametrize("start", FAR, ids=lambda start: str(start["x"]))


@FROM_FAR
@pytest.mark.parametrize(
    "solver",
    [
        LevenbergMarquardt(max_iterations=1000),
        LevenbergMarquardt(scaling=columns, max_iterations=1000),
        Dogleg(max_iterations=1000),
        Dogleg(rule=chumpy, max_iterations=1000),
    ],
    ids=["identity", "columns", "dogleg", "chumpy"],
)
def test_cost_falls_with_every_iterate(solver: Solver, start: Values) -> None:
    solution = solver.solve(rosenbrock()[0], start)
    assert (np.diff([iterate.cost for iterate in solution.trace]) < 0).all()
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [1, 1], atol=1e-5)


@pytest.mark.parametrize("solver", [LevenbergMarquardt, Dogleg])
def test_units_do_not_matter_when_columns_scale(solver: type) -> None:
    """With D = |J_i| the iterates are the same in any unit; with D = 1 they are not."""
    for scaling, alike in ((columns, True), (identity, False)):
        (problem, start), (other, other_start) = rosenbrock(), rosenbrock(1000.0)
        some = solver(scaling=scaling, max_iterations=5)
        ours = [i.values["x"] for i in some.solve(problem, start).trace]
        theirs = [i.values["x"] / [1, 1000.0] for i in some.solve(other, other_start).trace]
        same = len(ours) == len(theirs) and np.allclose(ours, theirs, rtol=1e-8)
        assert same is alike


def test_scalings_are_one_or_the_lengths_of_columns() -> None:
    here = Linearization(np.ones(2), np.array([[3.0, 0.0, 1.0], [4.0, 0.0, 0.0]]))
    np.testing.assert_array_equal(identity(here), [1, 1, 1])
    np.testing.assert_array_equal(columns(here), [5, 1, 1])  # what nothing sees stays put


# Levenberg-Marquardt.


def test_levenberg_marquardt_steps_are_the_damped_ones() -> None:
    problem, start = decay()
    first, second = LevenbergMarquardt().solve(problem, start).trace[:2]
    here = problem.linearize(start)
    fraction = LevenbergMarquardt().first_damping
    assert first.damping == pytest.approx(fraction * here.column_norms.max() ** 2)
    dampings = first.damping * np.cumprod([1, 2, 4, 8])  # Nielsen's, for steps that were refused
    taken = second.values["x"] - first.values["x"]
    assert min(np.linalg.norm(here.step(damping) - taken) for damping in dampings) < 1e-12


def test_damping_falls_as_fast_as_it_may_when_every_gain_is_one() -> None:
    dampings = [i.damping for i in LevenbergMarquardt().solve(*line()).trace]
    np.testing.assert_allclose(np.divide(dampings[1:], dampings[:-1]), 0.1)


# Between bounds.


@pytest.mark.parametrize("damping", [0.0, 0.1, 10.0])
def test_step_between_bounds_is_that_of_scipys_active_set_method(damping: float) -> None:
    for seed in range(6):
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


def test_convergence_is_quadratic_when_an_entry_is_at_its_bound() -> None:
    problem, start = decay(noise=0.0, bounds={"x": ([0.0, 1.3, 0.0], [5.0, 5.0, 5.0])})
    start = start | {"x": np.array([1.0, 1.3, 0.0])}
    solution = LevenbergMarquardt(gradient_tolerance=0.0, scaling=columns).solve(problem, start)
    assert solution.status is Status.CONVERGED
    errors = [np.linalg.norm(i.values["x"] - [2.0, 1.3, 0.5]) for i in solution.trace]
    tail = [e for e in errors if 1e-14 < e < 0.1]
    assert solution.iterations <= 12
    assert all(b < 0.2 * a for a, b in pairwise(tail))


def test_equal_bounds_fix_an_entry() -> None:
    x = Block("x", (3,)).symbol
    problem = Problem((Residual("r", x - 1.0, 1.0),), ("x",), {"x": ([0.2, -9, -9], [0.2, 9, 9])})
    solution = LevenbergMarquardt().solve(problem, {"x": np.zeros(3)})
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [0.2, 1, 1], atol=1e-6)


# The dogleg.


def chumpys_points(problem: Problem, start: Values, count: int) -> list[np.ndarray]:
    """The points accepted by chumpy's rules, written down once more.

    The first radius is |Gauss-Newton step|; above a gain of 0.9 it becomes 2.5 |step| at least,
    below 0.05 a quarter; what lowers the cost is taken.
    """
    x, fixed = problem.split(start)
    points, delta = [x.copy()], None
    for _ in range(count):
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
            rho = (r @ r - new @ new) / (r @ r - np.sum((r + J @ d) ** 2))
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
def test_dogleg_iterates_are_those_of_chumpy(build) -> None:
    problem, start = build()
    solution = Dogleg(rule=chumpy).solve(problem, start)
    assert solution.converged
    ours = [problem.free.pack(i.values) for i in solution.trace]
    assert len(ours) >= 6
    for mine, theirs in zip(ours, chumpys_points(problem, start, len(ours) - 1), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-9)


def test_dogleg_path_leads_downhill_all_the_way() -> None:
    """Farther along the path the linear model is lower (Powell 1970)."""
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
    assert (np.diff(costs) < 0).all()


def test_cauchy_point_is_the_least_along_the_gradient() -> None:
    rng = np.random.default_rng(1)
    here, D = Linearization(rng.normal(size=9), rng.normal(size=(9, 4))), rng.uniform(1, 2, 4)
    p, g = cauchy_point(here, D), here.gradient / D**2
    np.testing.assert_allclose(p / np.linalg.norm(p), -g / np.linalg.norm(g))
    for share in (0.99, 1.01):
        assert here.predicted_cost(share * p) > here.predicted_cost(p)


@pytest.mark.parametrize("rule", [chumpy, Dogleg().rule], ids=["chumpy", "textbook"])
def test_dogleg_solves_a_linear_problem_in_one_step(rule) -> None:
    problem, start = line()
    for far in (1.0, 1e-6, 1e6):
        solution = Dogleg(rule=rule).solve(problem, {"x": far * start["x"]})
        assert solution.status is Status.CONVERGED
        assert solution.iterations == 1


# First steps, which do not leap too far.

TIMES = np.linspace(0, 5, 30)
WIDE, WIDER = (1.5, 0.2), (3.0, 0.2)


def peak(
    start: tuple[float, float], turned: float = 0.0, sigma: float = 0.05
) -> tuple[Problem, Values]:
    """A peak at 2 of the steepness 1.5, and a start at which it is much too wide.

    The unknowns may be `turned` by an angle against center and steepness.
    """
    Q = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    x = Block("x", (2,)).symbol
    center, steepness = cs.vertsplit(Q @ x)
    curve = cs.exp(-(((TIMES - center) * steepness) ** 2)) - np.exp(-(((TIMES - 2.0) * 1.5) ** 2))
    return Problem((Residual("peak", curve, sigma),), "x"), {"x": Q.T @ np.array(start)}


@pytest.mark.parametrize(
    ("solver", "start"),
    [(GaussNewton(), WIDE), (Dogleg(), WIDE), (Ipopt(), WIDER), (Sqp(), WIDER)],
    ids=["gauss-newton", "dogleg", "ipopt", "sqp"],
)
def test_first_step_keeps_to_the_radius(solver: Solver, start: tuple[float, float]) -> None:
    problem, values = peak(start)
    solution = solver.solve(problem, values)
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [2.0, 1.5], rtol=1e-6)
    radius = FIRST_SHARE * np.linalg.norm(values["x"])
    assert solution.trace[1].step_norm <= radius * (1 + 1e-12)
