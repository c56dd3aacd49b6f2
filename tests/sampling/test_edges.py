"""Posteriors at the edges: modes on bounds, units far apart, starts and counts that will not do."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, Constraint, Problem, Residual, laplace
from workbench.errors import BadArgument
from workbench.sampling.conditioning import conditioning
from workbench.sampling.descent import log_scaled_tail, mode_from
from workbench.sampling.log_density import LogDensity
from workbench.sampling.subspace import fixed, subspace_of


def mass(problem: Problem, at: float) -> float:
    """By the mode next to a point of a problem in x alone."""
    x, given = problem.split({"x": at})
    target = LogDensity(problem, given, subspace_of(problem, x, given, "x", fixed))
    return mode_from(target, np.array([at])).log_mass


def test_a_mode_on_a_bound_has_the_mass_that_the_bound_leaves() -> None:
    """By quadrature, 5.1 % of the mass is at x = 0; with the whole Gaussian it would be 43 %."""
    x = Block("x").symbol
    rows = cs.vertcat(40 * (x - 2) * (x + 0.1), 8 * (1 - cs.exp(-10 * x)))
    problem = Problem((Residual("r", rows, 1.0),), "x", {"x": (0.0, np.inf)})
    there, here = mass(problem, 2.0), mass(problem, 0.0)
    assert 1 / (1 + np.exp(there - here)) == pytest.approx(0.051, abs=0.02)


def test_the_tail_of_a_gaussian_is_what_it_is() -> None:
    t = np.linspace(0, 40, 400_001)
    for u in (0.0, 0.5, 3.0):
        share = np.trapezoid(np.exp(-u * t - t**2 / 2), t) / np.sqrt(2 * np.pi)
        assert log_scaled_tail(np.array([u]))[0] == pytest.approx(np.log(share), abs=1e-6)


def test_a_unit_makes_no_posterior_improper() -> None:
    x, y = Block("x").symbol, Block("y").symbol
    problem = Problem((Residual("r", cs.vertcat(1e-18 * x - 1, y), 1.0),), ("x", "y"))
    found = laplace(problem, {"x": 1e18, "y": 0.0})
    np.testing.assert_allclose(found.sd, [1e18, 1.0], rtol=0.1)  # 4000 draws: 1.1 % is one sigma


def test_limits_of_a_constraint_say_as_much_as_bounds() -> None:
    """y is known to 1e-6 either way, so holding it fixed narrows nothing."""
    x, y = Block("x").symbol, Block("y").symbol
    rows = Residual("r", cs.vertcat(x + y - 1, 0.01 * y), 1.0)
    bounded = Problem((rows,), ("x", "y"), {"y": (-1e-6, 1e-6)})
    limited = Problem((rows,), ("x", "y"), constraints=(Constraint("c", y, -1e-6, 1e-6),))
    for problem in (bounded, limited):
        at, given = problem.split({"x": 1.0, "y": 0.0})
        space = subspace_of(problem, at, given, "x", fixed)
        assert conditioning(problem, given, space, np.array([1.0])).ratios[0] < 1.001


@pytest.mark.parametrize("draws", [0, 3])
def test_too_few_draws_are_refused(draws: int) -> None:
    problem = Problem((Residual("r", Block("x").symbol, 1.0),), "x")
    with pytest.raises(BadArgument, match="too few to judge by; ask for"):
        laplace(problem, {"x": 0.0}, draws=draws)


def test_a_start_without_a_residual_is_refused() -> None:
    problem = Problem((Residual("r", cs.log(Block("x").symbol), 1.0),), "x")
    with pytest.raises(BadArgument, match="is not finite where Laplace"):
        laplace(problem, {"x": -1.0})
