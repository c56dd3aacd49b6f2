"""Refits: other minima along weak directions, and profile likelihoods."""

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose

import workbench as wb
from workbench.errors import BadArgument, UnknownName
from workbench.fitting import OtherMinima, Profile, other_minima, profile_likelihood
from workbench.residuals import Residual

X = wb.Block("x", (2,), "m")


def minima_of(expression: cs.MX, start: tuple[float, float], directions: int = 2) -> OtherMinima:
    problem = wb.Problem([Residual("r", expression, 1.0)], ["x"])
    values = wb.solve(problem, {"x": np.array(start)}).values
    return other_minima(problem, values, directions=directions)


def wells() -> cs.MX:
    """A double well in x[0], a little lower on the left."""
    return cs.vertcat(X.symbol[0] ** 2 - 0.5, 0.1 * (X.symbol[0] + 2), 3 * X.symbol[1])


def test_second_well_is_found_from_either_side() -> None:
    right = minima_of(wells(), (1, 0))
    assert [one.entry for one in right.better] == ["x[0]"]
    assert right.better[0].values["x"][0] == pytest.approx(-0.70, abs=0.03)
    assert "The fit was not at the best minimum." in str(right)
    left = minima_of(wells(), (-1, 0))
    assert not left.better
    assert left.minima[0].excess == pytest.approx(-right.better[0].excess, rel=1e-6)
    assert "above" in str(left)
    assert left.starts == left.came_back + left.minima[0].starts == 8


def test_valley_is_told_from_a_minimum() -> None:
    found = minima_of(
        cs.vertcat(X.symbol[0] - X.symbol[1], 2 * (X.symbol[0] - X.symbol[1])), (0.3, 0.1)
    )
    assert not found.minima
    assert found.valley
    assert all(abs(one.excess) < 1e-6 for one in found.valley)
    assert "where a fit ends in it is arbitrary" in str(found)


def test_refits_stay_between_bounds() -> None:
    problem = wb.Problem([Residual("r", wells(), 1.0)], ["x"], bounds={"x[0]": (0.1, 2.0)})
    values = wb.solve(problem, {"x": np.array([1.0, 0.0])}).values
    found = other_minima(problem, values, directions=2)
    assert all(0.1 <= one.values["x"][0] <= 2.0 for one in (*found.minima, *found.valley))
    with pytest.raises(BadArgument, match="one direction or more"):
        other_minima(problem, values, directions=0)


def profile_of(expression: cs.MX, start: tuple[float, float], entry: str = "x[0]") -> Profile:
    """The profile of a residual with a sigma of 1, from its minimum near `start`."""
    problem = wb.Problem([Residual("r", expression, 1.0)], ["x"], blocks=[X])
    values = wb.solve(problem, {"x": np.array(start)}).values
    return profile_likelihood(problem, values, entry, level=0.9)


def test_of_a_linear_problem_is_a_parabola() -> None:
    A, b = np.array([[1.0, 2.0], [0.5, -1.0], [0.3, 0.1]]), np.array([1.0, 2.0, 3.0])
    found = profile_of(cs.mtimes(cs.DM(A), X.symbol) - b, (0, 0))
    sd = np.sqrt(np.linalg.inv(A.T @ A)[0, 0])
    assert found.sd == pytest.approx(sd)
    assert found.unit == "m"
    least = found.costs.min()
    assert_allclose(found.costs - least, ((found.at - found.best) / sd) ** 2 / 2, atol=1e-9)
    assert_allclose(found.interval, found.best + sd * 1.6448536 * np.array([-1, 1]), rtol=1e-6)
    assert_allclose(found.interval, found.laplace, rtol=1e-6)
    assert found.lower is None


def test_profile_interval_of_an_exponential_is_exact() -> None:
    """exp(x0) is observed as 1 with a sigma of 0.5: ends are at log(1 +- 0.5 z)."""
    x = X.symbol
    found = profile_of(cs.vertcat(2 * (cs.exp(x[0] + 0 * x[1]) - 1), x[1] - x[0]), (0.1, 0.1))
    z = 1.6448536
    low, high = found.interval
    assert low == pytest.approx(np.log(1 - 0.5 * z), abs=0.05)
    assert high == pytest.approx(np.log(1 + 0.5 * z), abs=0.02)
    assert -low > 2 * high
    a, b = found.laplace
    assert -a == pytest.approx(b, abs=1e-5)


def test_profile_may_be_open_on_one_side() -> None:
    """A saturating response: whatever is large enough gives the same."""
    x = X.symbol
    found = profile_of(cs.vertcat(3 * (cs.tanh(x[0]) - 0.9), x[1] - x[0]), (1.0, 1.0))
    low, high = found.interval
    assert np.isfinite(low)
    assert high == np.inf
    assert "x[0] is above" in str(found)
    assert "on the other side nothing bounds it up to" in str(found)


def test_of_an_undetermined_entry_is_unbounded() -> None:
    x = X.symbol
    found = profile_of(cs.vertcat(x[0] - x[1], 2 * (x[0] - x[1])), (1.0, 1.0))
    assert found.sd == np.inf
    assert found.interval == (-np.inf, np.inf)
    assert str(found).startswith("nothing bounds x[0] between")


def test_profile_reports_a_lower_minimum() -> None:
    """Minima at -1 and 1 of a tilted double well; the fit is in the worse one."""
    x = X.symbol
    r = cs.vertcat(x[0] ** 2 - 1, 0.3 * (x[0] + 2), x[1] - x[0])
    found = profile_of(r, (1.0, 1.0))
    assert found.best > 0.8
    assert found.lower is not None
    assert found.lower["x"][0] < -0.8
    assert "a lower minimum" in str(found)


def test_bad_profile_arguments_are_refused() -> None:
    problem = wb.Problem([Residual("r", X.symbol, 1.0)], ["x"], blocks=[X])
    values = {"x": np.zeros(2)}
    with pytest.raises(UnknownName, match=r"x\[0\]"):
        profile_likelihood(problem, values, "x[7]")
    with pytest.raises(BadArgument, match="between 0 and 1, not 2"):
        profile_likelihood(problem, values, "x[0]", level=2)
    with pytest.raises(BadArgument, match="is all that is free"):
        profile_likelihood(problem.freeing("x[0]"), values, "x[0]")
