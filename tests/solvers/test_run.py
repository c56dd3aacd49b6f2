"""The judge of every run: what a solver says of itself does not count."""

import weakref
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import TEN, decay, rosenbrock
from tests.tiers import few
from workbench import SOLVERS, Block, GaussNewton, Linearization, Problem, Residual, Status
from workbench.arrays import Array
from workbench.errors import NotSupported
from workbench.solvers import Boxes, Derivative
from workbench.solvers.limits import Stop
from workbench.solvers.run import Best, Run


def test_claimed_convergence_is_judged() -> None:
    problem, start = decay()
    with Run("boastful", GaussNewton(), problem, start, None) as run:
        run.linearize(run.x)
        raise Stop(Status.CONVERGED)
    solution = run.solution()
    assert solution.optimality > 1e-3
    assert solution.status is Status.STALLED
    assert solution.message == Status.STALLED.value


def test_giving_up_at_a_minimum_is_convergence() -> None:
    problem, start = decay()
    minimum = GaussNewton().solve(problem, start).values
    with Run("modest", GaussNewton(), problem, start | minimum, None) as run:
        run.linearize(run.x)
        run.stall()
    assert run.solution().status is Status.CONVERGED


def test_rounding_ties_take_the_more_stationary_point() -> None:
    """The cost 4 + x^2, in which x = 1e-8 does not show, and the gradient 2 x, in which it does."""
    x = Block("x").symbol
    problem = Problem((Residual("beside 0", cs.vertcat(2 + x, 2 - x), 1.0),), ("x",))
    far, near = np.array([1e-8]), np.array([0.5e-8])
    with Run("careful", GaussNewton(), problem, {"x": 1e-8}, None) as run:
        assert run.gain_ratio(far, run.linearize(far), near, 1e-25) == 1.0
        assert run.gain_ratio(near, run.linearize(near), far, 1e-25) == -np.inf
        assert run.meter.counts["jacobian"] > 1


def test_nothing_evaluated_leaves_the_start() -> None:
    problem, start = decay()
    with Run("idle", GaussNewton(max_evaluations=0), problem, start, None) as run:
        run.linearize(run.x)
    solution = run.solution()
    assert solution.status is Status.MAX_EVALUATIONS
    assert solution.cost == float("inf")
    assert (solution.values["x"] == start["x"]).all()


# The best point.


def test_what_is_feasible_is_better_than_what_is_cheap() -> None:
    best = Best(np.zeros(1))
    best.offer(np.array([1.0]), 1.0, 30.0)
    best.offer(np.array([2.0]), 9.0, 20.0)
    assert best.x[0] == 2.0  # misses less
    best.offer(np.array([3.0]), 10.0, 0.5)
    best.offer(np.array([4.0]), 8.0, 0.9)
    best.offer(np.array([5.0]), 0.0, 1.1)
    assert best.x[0] == 4.0
    best.settle(np.array([5.0]), 0.0, 1.1, optimality=0.0, noise=100.0)
    assert best.decide(0.1) == 0.1


# Gains that rounding hides.


# What they can.


@pytest.mark.parametrize("name", few(SOLVERS, TEN))
def test_abilities_are_what_they_do(name: str) -> None:
    abilities = SOLVERS[name].abilities
    assert abilities.source
    bounds = {"x": (-3.0, 3.0)}
    problem = Problem(rosenbrock()[0].residuals, ("x",), bounds)
    start = {"x": np.array([-1.2, 1.0])}
    if abilities.bounds is Boxes.REFUSED:
        with pytest.raises(NotSupported, match="takes no bounds, but the problem bounds x"):
            SOLVERS[name].solve(problem, start)
        problem = Problem(problem.residuals, ("x",))
    counts = replace(SOLVERS[name], max_evaluations=500).solve(problem, start).evaluations
    asked = (counts.residual, counts.gradient, counts.jacobian, counts.hessian)
    assert (asked[3] > 0) is (abilities.derivative is Derivative.HESSIAN)
    assert (asked[1] > 0) is (abilities.derivative is Derivative.GRADIENT)
    if abilities.derivative is Derivative.COST:
        assert asked[2] <= 2  # the scaling at the start, and the judge at the end
    assert not (abilities.is_global and abilities.bounds is not Boxes.NEEDED)


@pytest.mark.parametrize("name", ["trust-region", "gauss-newton", "levenberg-marquardt", "dogleg"])
def test_the_memory_of_a_linearization_serves_the_next_one(name: str) -> None:
    problem, start = rosenbrock()
    linearize, alive = problem.linearize_at, weakref.WeakSet[Linearization]()
    counts = []

    def watched(x: Array, fixed: Array) -> Linearization:
        counts.append(len(alive))
        here = linearize(x, fixed)
        alive.add(here)
        return here

    problem.linearize_at = watched  # type: ignore[method-assign]
    assert SOLVERS[name].solve(problem, start).converged
    assert len(counts) > 5
    assert set(counts) == {0}
