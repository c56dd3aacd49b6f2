"""First steps do not leap to where nothing changes the residual any more."""

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import body_fit, rosenbrock
from workbench import Block, Problem, Residual, Solution, Solver, Values
from workbench.solvers import SOLVERS, Damped, Dogleg, GaussNewton, Ipopt, Sqp, chumpy, full_step
from workbench.solvers.abilities import DAMPED, IN_A_RADIUS, OWN, WHOLE
from workbench.solvers.run import Run
from workbench.solvers.trust_radius import (
    AGREED,
    FIRST,
    GROWTH,
    TRUSTED,
    first_radius,
    radius_after,
    trusted,
)

T = np.linspace(0, 5, 30)
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
    curve = cs.exp(-(((T - center) * steepness) ** 2)) - np.exp(-(((T - 2.0) * 1.5) ** 2))
    return Problem((Residual("peak", curve, sigma),), "x"), {"x": Q.T @ np.array(start)}


def steps(solution: Solution) -> list[float]:
    return [iterate.step_norm for iterate in solution.trace[1:]]


@pytest.mark.parametrize(
    ("solver", "start"),
    [(GaussNewton(), WIDE), (Dogleg(), WIDE), (Ipopt(), WIDER), (Sqp(), WIDER)],
    ids=["gauss-newton", "dogleg", "ipopt", "sqp"],
)
def test_the_first_step_keeps_to_the_radius_and_finds_the_way(
    solver: Solver, start: tuple[float, float]
) -> None:
    problem, values = peak(start)
    solution = solver.solve(problem, values)
    assert solution.converged
    np.testing.assert_allclose(solution.values["x"], [2.0, 1.5], rtol=1e-6)
    assert steps(solution)[0] <= FIRST * np.linalg.norm(values["x"]) * (1 + 1e-12)


@pytest.mark.parametrize(
    "solver", [GaussNewton(line_search=full_step), Dogleg(rule=chumpy)], ids=["full", "chumpy"]
)
def test_whole_steps_leap_as_they_are_described(solver: Solver) -> None:
    problem, values = peak(WIDE)
    solution = solver.solve(problem, values)
    assert solution.cost > 500
    assert np.abs(solution.values["x"]).max() > 10


def test_the_radius_at_the_start() -> None:
    x, D = np.array([3.0, -4.0]), np.array([1.0, 2.0])
    assert first_radius(x, np.ones(2)) == pytest.approx(FIRST * 5)
    assert first_radius(x, D) == pytest.approx(FIRST * np.hypot(3, 8))
    assert first_radius(np.zeros(2), D) == first_radius(x / 1e6, D) == FIRST
    assert first_radius(x, D, np.inf) == np.inf
    assert FIRST < 1  # a step of one unknown does not end on zero


def test_the_radius_after_a_step() -> None:
    p, change = np.array([0.3, 0.4]), np.array([5.0, 0.0, 0.0])
    bent = np.array([0.0, 1.0, 0.0])
    assert radius_after(p, change, bent) == pytest.approx(0.5 * GROWTH)
    assert radius_after(p, change, bent / 100) == pytest.approx(0.5 * TRUSTED * 500)
    assert radius_after(p, change, 0 * bent) > 1e10


def test_the_way_out_of_the_radius_ends_where_the_model_does() -> None:
    """tanh bends away from its tangent at 0, which promises that the residual vanishes at 1."""
    problem = Problem((Residual("bends", cs.tanh(Block("x").symbol) - 1, 1.0),), "x")
    with Run("gauss-newton", GaussNewton(), problem, {"x": np.array(0.0)}, None) as run:
        here = run.begin()
        held = [
            size * trusted(run, run.x, here, lambda times, p=size: np.array([times * p]), 1 / size)
            for size in (1 / 64, 1 / 32, 0.9)
        ]

        def share(x: float) -> float:
            return (here.cost - run.cost(np.array([x]))) / here.predicted_decrease(np.array([x]))

        assert held[0] == held[1] > 1 / 32
        assert share(held[0]) >= AGREED > share(2 * held[0])
        assert held[2] == 0
        assert run.meter.counts["jacobian"] == 1


def test_a_near_body_takes_no_more_jacobians_than_with_whole_steps() -> None:
    whole = GaussNewton(line_search=full_step).solve(*body_fit())
    within = GaussNewton().solve(*body_fit())
    assert within.converged
    assert within.evaluations.jacobian <= whole.evaluations.jacobian


def test_no_step_is_longer_than_was_allowed_after_the_one_before() -> None:
    problem, values = rosenbrock()
    solution = GaussNewton().solve(problem, values)
    radius, bound = first_radius(values["x"], np.ones(2)), 0
    for before, after in zip(solution.trace, solution.trace[1:], strict=False):
        here, there = problem.linearize(before.values), problem.linearize(after.values)
        p = after.values["x"] - before.values["x"]
        assert np.linalg.norm(p) <= radius * (1 + 1e-9)
        whole = here.step()
        within = whole * min(1.0, radius / np.linalg.norm(whole))
        bound += np.linalg.norm(within) < np.linalg.norm(whole)
        allowed = radius_after(p, here.along(p), there.residual - here.residual - here.along(p))
        cut = np.linalg.norm(p) < 0.99 * np.linalg.norm(within)
        radius = allowed if cut else max(radius, allowed)
    assert bound > 0  # else the radius was no constraint


def test_neither_a_turn_of_the_unknowns_nor_sigma_changes_the_way() -> None:
    turn, angle = 0.7, np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    for solver in (GaussNewton(max_iterations=6), Dogleg(max_iterations=6)):
        ours = [i.values["x"] for i in solver.solve(*peak(WIDE)).trace]
        turned = [angle @ i.values["x"] for i in solver.solve(*peak(WIDE, turn)).trace]
        other = [i.values["x"] for i in solver.solve(*peak(WIDE, sigma=5.0)).trace]
        np.testing.assert_allclose(turned, ours, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(other, ours, rtol=1e-6, atol=1e-6)


def test_the_first_damping_is_as_large_as_the_radius_needs() -> None:
    problem, values = peak(WIDER)
    with Run("ipopt", Ipopt(), problem, values, None) as run:
        here = run.linearize(run.x)
        H = Damped().along(run)(run.x, np.zeros(0))
        radius = first_radius(run.x, np.ones(2))
        assert np.linalg.norm(here.step()) > radius
        assert np.linalg.norm(np.linalg.solve(H, here.gradient)) <= radius
        half = here.normal + (H - here.normal) / 2
        assert np.linalg.norm(np.linalg.solve(half, here.gradient)) > radius


def test_every_solver_says_how_far_its_first_step_may_lead() -> None:
    said = {name: solver.abilities.first_step for name, solver in SOLVERS.items()}
    assert {said["gauss-newton"], said["dogleg"], said["ipopt"], said["sqp"]} == {IN_A_RADIUS}
    whole = ("gauss-newton-full", "dogleg-chumpy", "newton", "ipopt-exact", "ipopt-lbfgs")
    assert {said[name] for name in whole} == {WHOLE}
    assert said["levenberg-marquardt"] == DAMPED
    assert said["nlopt-lbfgs"] == OWN
    assert Sqp(hessian=Damped()).abilities.first_step == IN_A_RADIUS
