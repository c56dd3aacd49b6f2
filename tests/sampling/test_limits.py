"""Bounds and constraints end a posterior: no draw lies beyond them, or it is refused."""

import casadi as cs
import numpy as np
import pytest
import scipy.stats

import workbench as wb
from tests.sampling.densities import gaussian
from tests.tiers import few
from workbench.errors import BadArgument
from workbench.sampling import laplace, sample
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import mode_from
from workbench.sampling.subspace import fixed, subspace_of


def pulled(away: float) -> wb.Problem:
    """x ~ N(-away, 1) with x >= 0."""
    x = wb.Block("x")
    return wb.Problem([wb.Residual("pull", x.symbol + away, 1.0)], "x", {"x": (0.0, np.inf)}, [x])


@pytest.mark.parametrize("away", few([3.0, 30.0], 1))
def test_laplace_on_a_bound_is_the_truncated_gaussian(away: float) -> None:
    posterior = laplace(pulled(away), {"x": 0.0})
    assert posterior.flat.min() >= 0
    truth = scipy.stats.truncnorm(away, np.inf, loc=-away)
    found = posterior.interval(0.9)[0]
    # a quantile of 4000 draws is off by sqrt(q (1 - q) / 4000) of its level
    np.testing.assert_allclose(truth.cdf(found), [0.05, 0.95], atol=4 * np.sqrt(0.0475 / 4000))
    if away == 3.0:
        np.testing.assert_allclose(truth.ppf([0.05, 0.95]), [0.016, 0.817], atol=5e-4)


def ring(radius: float = 1.0) -> wb.Problem:
    """N(0.4, 1/4) of two, outside a circle."""
    y = wb.Block("y", (2,))
    hole = wb.Constraint("hole", cs.sumsqr(y.symbol), radius**2, np.inf)
    return wb.Problem([wb.Residual("r", y.symbol - 0.4, 0.5)], "y", blocks=[y], constraints=[hole])


def test_laplace_tells_how_many_draws_violate_constraints() -> None:
    posterior = laplace(ring(), {"y": [0.71, 0.71]})
    beyond = float(np.mean(np.sum(posterior.flat**2, axis=1) < 1 - 1e-6))
    assert beyond == posterior.importance.outside == 0  # a circle is outside of its tangent
    assert posterior.importance.cut_off > 0.2  # which leaves out what the circle allows
    assert not posterior.usable
    assert "of what they allow" in posterior.verdict
    within = wb.Block("y", (2,))
    disc = wb.Constraint("disc", cs.sumsqr(within.symbol), -np.inf, 1.0)
    problem = wb.Problem(
        [wb.Residual("r", within.symbol - 0.9, 0.5)], "y", blocks=[within], constraints=[disc]
    )
    posterior = laplace(problem, {"y": [0.7, 0.7]})
    beyond = float(np.mean(np.sum(posterior.flat**2, axis=1) > 1 + 1e-6))
    assert posterior.importance.outside == pytest.approx(beyond)
    assert beyond > 0.1
    assert not posterior.usable
    assert f"{beyond:.1%} of the draws outside" in posterior.verdict


def test_linear_constraints_cut_laplace_exactly() -> None:
    y = wb.Block("y", (2,))
    half_plane = wb.Constraint("half plane", y.symbol[0] + y.symbol[1], 2.0, np.inf)
    problem = wb.Problem(
        [wb.Residual("r", y.symbol, 1.0)], "y", blocks=[y], constraints=[half_plane]
    )
    posterior = laplace(problem, {"y": [1.0, 1.0]})
    assert posterior.usable, posterior.verdict
    along = posterior.flat.sum(axis=1) / np.sqrt(2)
    assert along.min() >= np.sqrt(2) - 1e-6
    truth = scipy.stats.truncnorm(np.sqrt(2), np.inf)
    found = truth.cdf(np.quantile(along, [0.05, 0.5, 0.95]))
    np.testing.assert_allclose(found, [0.05, 0.5, 0.95], atol=4 * 0.5 / np.sqrt(4000))


@pytest.mark.parametrize("way", [sample, laplace])
def test_equations_of_drawn_numbers_are_refused(way: object) -> None:
    y = wb.Block("y", (3,))
    tie = wb.Constraint("tie", y.symbol[0] - y.symbol[1] ** 2, 0.0, 0.0)
    problem = wb.Problem([wb.Residual("r", y.symbol, 0.5)], "y", blocks=[y], constraints=[tie])
    at = {"y": np.zeros(3)}  # where the derivative by y[1] vanishes
    for names in ("y", "y[0]", "y[1]"):
        with pytest.raises(wb.WorkbenchError, match=r"tie is an equation .* residual"):
            way(problem, at, names)  # type: ignore[operator]
    alone = laplace(problem, at, "y[2]")
    assert alone.usable, alone.verdict


def test_equal_bounds_are_refused() -> None:
    problem = gaussian(np.eye(2))
    pinned = wb.Problem(
        problem.residuals, "x", {"x": ([0.0, -1.0], [0.0, 1.0])}, problem.free.blocks
    )
    for way in (sample, laplace):
        with pytest.raises(wb.WorkbenchError, match=r"x\[0\] has equal bounds"):
            way(pinned, {"x": np.zeros(2)})
    assert laplace(pinned, {"x": np.zeros(2)}, "x[1]").usable


@pytest.mark.thorough
def test_integrating_beyond_a_bound_is_told() -> None:
    """y is half a Gaussian; the Gaussian about the ridge has the other half too."""
    x, y, more = wb.Block("x"), wb.Block("y"), wb.Block("more", (20,))
    blocks = [x, y, more]
    terms = [wb.Residual(block.name, block.symbol, 1.0) for block in blocks]
    problem = wb.Problem(terms, ("x", "y", "more"), {"y": (0.0, np.inf)}, blocks)
    at = {"x": 0.0, "y": 0.0, "more": np.zeros(20)}
    few = sample(problem, at, "x", steps=900, walkers=16)
    assert few.importance is not None
    assert few.importance.outside == pytest.approx(0.5, abs=0.04)
    assert "% of the draws outside bounds or constraints" in few.verdict
    assert "take 1,000 steps or more" in few.verdict
    posterior = sample(problem, at, "x", steps=2000, walkers=16)
    assert posterior.usable, posterior.verdict
    assert posterior.importance is None
    assert posterior.points(1000)[:, 1].min() >= 0  # drawn with x, and within its bound


def test_starts_beyond_limits_are_refused() -> None:
    with pytest.raises(wb.WorkbenchError, match=r"hole is 0\.18, below its limit 1"):
        sample(ring(), {"y": [0.3, 0.3]}, steps=100)
    with pytest.raises(wb.WorkbenchError, match="x is -1, outside its bounds of 0 to inf"):
        sample(pulled(1.0), {"x": -1.0}, steps=100)


def mass(problem: wb.Problem, at: float) -> float:
    """By the mode next to a point of a problem in x alone."""
    x, given = problem.split({"x": at})
    target = LogDensity(problem, given, subspace_of(problem, x, given, "x", fixed))
    return mode_from(target, np.array([at])).log_mass


def test_mode_on_a_bound_has_the_mass_left() -> None:
    """By quadrature, 5.1 % of the mass is at x = 0; with the whole Gaussian it would be 43 %."""
    x = wb.Block("x").symbol
    rows = cs.vertcat(40 * (x - 2) * (x + 0.1), 8 * (1 - cs.exp(-10 * x)))
    problem = wb.Problem((wb.Residual("r", rows, 1.0),), "x", {"x": (0.0, np.inf)})
    there, here = mass(problem, 2.0), mass(problem, 0.0)
    assert 1 / (1 + np.exp(there - here)) == pytest.approx(0.051, abs=0.02)


def test_units_make_no_posterior_improper() -> None:
    x, y = wb.Block("x").symbol, wb.Block("y").symbol
    problem = wb.Problem((wb.Residual("r", cs.vertcat(1e-18 * x - 1, y), 1.0),), ("x", "y"))
    found = laplace(problem, {"x": 1e18, "y": 0.0})
    np.testing.assert_allclose(found.sd, [1e18, 1.0], rtol=0.1)  # 4000 draws: 1.1 % is one sigma


def test_too_few_draws_are_refused() -> None:
    problem = wb.Problem((wb.Residual("r", wb.Block("x").symbol, 1.0),), "x")
    with pytest.raises(BadArgument, match="too few to judge by; ask for"):
        laplace(problem, {"x": 0.0}, draws=3)


def test_start_without_finite_residual_is_refused() -> None:
    problem = wb.Problem((wb.Residual("r", cs.log(wb.Block("x").symbol), 1.0),), "x")
    with pytest.raises(BadArgument, match="is not finite where Laplace"):
        laplace(problem, {"x": -1.0})
