"""Radii and dampings: first steps do not leap too far, later ones follow the gain."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, Problem, Residual, Solution, Solver, Values
from workbench.experiments import find
from workbench.solvers import (
    Damped,
    Dogleg,
    GaussNewton,
    Ipopt,
    Sqp,
    chumpy,
    full_step,
)
from workbench.solvers.dogleg import (
    FIRST,
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


def test_turned_unknowns_and_sigma_change_no_iterate() -> None:
    turn, angle = 0.7, np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    for solver in (GaussNewton(max_iterations=6), Dogleg(max_iterations=6)):
        ours = [i.values["x"] for i in solver.solve(*peak(WIDE)).trace]
        turned = [angle @ i.values["x"] for i in solver.solve(*peak(WIDE, turn)).trace]
        other = [i.values["x"] for i in solver.solve(*peak(WIDE, sigma=5.0)).trace]
        np.testing.assert_allclose(turned, ours, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(other, ours, rtol=1e-6, atol=1e-6)


# Damping, which follows the gain.


@pytest.mark.thorough
@pytest.mark.parametrize("solver", [Ipopt(), Sqp(), Ipopt(hessian=Damped(1e-2))])
def test_a_nearly_singular_fit_is_solved_by_damped_steps(solver: Solver) -> None:
    setup = find("body-points-lbs", {"start": 3}).setup()
    assert setup.known is not None
    found = solver.solve(setup.problem, setup.start)
    assert found.converged
    assert found.cost == pytest.approx(setup.known.cost, rel=1e-6)
