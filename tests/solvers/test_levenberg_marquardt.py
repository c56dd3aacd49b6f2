"""Levenberg-Marquardt's descent, and what its scaling means."""

import numpy as np
import pytest

from tests.solvers.problems import body_fit, decay, line, rosenbrock
from workbench import LevenbergMarquardt, Linearization
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
