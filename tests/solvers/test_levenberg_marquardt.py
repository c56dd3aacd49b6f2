"""Levenberg-Marquardt's descent, and what its scaling means."""

import casadi as cs
import numpy as np
import pytest
import scipy.optimize

from tests.solvers.problems import body_fit, decay, line, rosenbrock
from workbench import Block, LevenbergMarquardt, Linearization, Problem, Residual
from workbench.problem import steps
from workbench.solvers import columns, identity

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


def test_the_cost_falls_on_a_body_too() -> None:
    solution = LevenbergMarquardt().solve(*body_fit())
    assert (np.diff([iterate.cost for iterate in solution.trace]) < 0).all()


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


@pytest.mark.parametrize("n", [8, 10, 11, 12])
def test_a_column_that_vanishes_gives_no_licence(n: int) -> None:
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
