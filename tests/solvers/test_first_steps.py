"""Radii and dampings: first steps do not leap too far, later ones follow the gain."""

import casadi as cs
import numpy as np
import pytest

from tests.solvers.problems import body_fit
from workbench import Block, Constraint, Problem, Residual, Solution, Solver, Values
from workbench.experiments import find
from workbench.solvers import (
    Damped,
    Dogleg,
    GaussNewton,
    Ipopt,
    Sqp,
    chumpy,
    full_step,
    gauss_newton_hessian,
)
from workbench.solvers.damping import eased
from workbench.solvers.run import Run
from workbench.solvers.trust_radius import (
    FIRST,
    GROWTH,
    TRUSTED,
    first_radius,
    radius_after,
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
def test_the_first_step_keeps_to_the_radius(solver: Solver, start: tuple[float, float]) -> None:
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


def test_radii_cost_no_jacobians_near_the_end() -> None:
    whole = GaussNewton(line_search=full_step).solve(*body_fit())
    within = GaussNewton().solve(*body_fit())
    assert within.converged
    assert within.evaluations.jacobian <= whole.evaluations.jacobian


def test_turned_unknowns_and_sigma_change_no_iterate() -> None:
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


# Damping, which follows the gain.


def test_damping_follows_the_gain() -> None:
    assert eased(1.0) == pytest.approx(0.1)
    assert eased(0.5) == 1.0
    assert eased(1e-9) == pytest.approx(2.0)
    gains = np.linspace(0.01, 3, 50)
    assert (np.diff([eased(gain) for gain in gains]) <= 0).all()


def curved() -> tuple[Problem, dict[str, np.ndarray]]:
    x = Block("x", (2,)).symbol
    r = cs.vertcat(x[0] - 1, 10 * (x[1] - x[0] ** 2))
    return Problem([Residual("r", r, 1.0)], ["x"]), {"x": np.array([-1.2, 1.0])}


@pytest.mark.thorough
@pytest.mark.parametrize("solver", [Ipopt(), Sqp(), Ipopt(hessian=Damped(1e-2))])
def test_a_nearly_singular_fit_is_solved_by_damped_steps(solver: Solver) -> None:
    setup = find("body-points-lbs", {"start": 3}).setup()
    assert setup.known is not None
    found = solver.solve(setup.problem, setup.start)
    assert found.converged
    assert found.cost == pytest.approx(setup.known.cost, rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("solver", [Ipopt, Sqp])
def test_undamped_the_line_search_cuts_each_step_of_it(solver: type[Ipopt] | type[Sqp]) -> None:
    setup = find("body-points-lbs", {"start": 3}).setup()
    assert setup.known is not None
    assert setup.known.cost is not None
    undamped = solver(hessian=gauss_newton_hessian, max_iterations=200)
    found = undamped.solve(setup.problem, setup.start)
    assert not found.converged
    assert found.cost > 1.1 * setup.known.cost
    assert found.evaluations.residual > 2 * found.evaluations.jacobian


def test_with_constraints_nothing_is_damped() -> None:
    """There, line searches cut steps for the constraints' sake, too."""
    x = Block("x", (2,)).symbol
    circle = Constraint("circle", cs.sumsqr(x), 1.0, 1.0)
    problem = Problem([Residual("r", x - cs.DM([2, 1]), 1.0)], ["x"], constraints=[circle])
    with Run("test", Ipopt(), problem, {"x": np.array([1.0, 0.0])}, None) as run:
        np.testing.assert_array_equal(Damped().along(run)(run.x, np.zeros(1)), np.eye(2))
