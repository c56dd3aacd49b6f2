"""Profile likelihoods: exact for linear problems, lopsided, open, and past a lower minimum."""

from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

import workbench as wb
from workbench.cli.app import app
from workbench.errors import BadArgument, UnknownName
from workbench.fitting import Profile, profile_likelihood
from workbench.residuals import Residual

X = wb.Block("x", (2,), "m")


def of(expression: cs.MX, start: tuple[float, float], entry: str = "x[0]") -> Profile:
    """The profile of a residual with a sigma of 1, from its minimum near `start`."""
    problem = wb.Problem([Residual("r", expression, 1.0)], ["x"], blocks=[X])
    values = wb.solve(problem, {"x": np.array(start)}).values
    return profile_likelihood(problem, values, entry, level=0.9)


def test_the_profile_of_a_linear_problem_is_laplaces_parabola() -> None:
    A, b = np.array([[1.0, 2.0], [0.5, -1.0], [0.3, 0.1]]), np.array([1.0, 2.0, 3.0])
    found = of(cs.mtimes(cs.DM(A), X.symbol) - b, (0, 0))
    sd = np.sqrt(np.linalg.inv(A.T @ A)[0, 0])
    assert found.sd == pytest.approx(sd)
    assert found.unit == "m"
    least = found.costs.min()
    assert_allclose(found.costs - least, ((found.at - found.best) / sd) ** 2 / 2, atol=1e-9)
    assert_allclose(found.interval, found.best + sd * 1.6448536 * np.array([-1, 1]), rtol=1e-6)
    assert_allclose(found.interval, found.laplace, rtol=1e-6)
    assert found.lower is None


def test_a_lopsided_cost_has_a_lopsided_interval() -> None:
    """exp(x0) is observed as 1 with a sigma of 0.5: ends are at log(1 +- 0.5 z)."""
    x = X.symbol
    found = of(cs.vertcat(2 * (cs.exp(x[0] + 0 * x[1]) - 1), x[1] - x[0]), (0.1, 0.1))
    z = 1.6448536
    low, high = found.interval
    assert low == pytest.approx(np.log(1 - 0.5 * z), abs=0.05)
    assert high == pytest.approx(np.log(1 + 0.5 * z), abs=0.02)
    assert -low > 2 * high
    a, b = found.laplace
    assert -a == pytest.approx(b, abs=1e-5)


def test_an_open_side_is_said() -> None:
    """A saturating response: whatever is large enough gives the same."""
    x = X.symbol
    found = of(cs.vertcat(3 * (cs.tanh(x[0]) - 0.9), x[1] - x[0]), (1.0, 1.0))
    low, high = found.interval
    assert np.isfinite(low)
    assert high == np.inf
    assert "x[0] is above" in str(found)
    assert "on the other side nothing bounds it up to" in str(found)


def test_what_nothing_sees_is_bounded_by_nothing() -> None:
    x = X.symbol
    found = of(cs.vertcat(x[0] - x[1], 2 * (x[0] - x[1])), (1.0, 1.0))
    assert found.sd == np.inf
    assert found.interval == (-np.inf, np.inf)
    assert str(found).startswith("nothing bounds x[0] between")


def test_a_lower_minimum_on_the_way_is_told() -> None:
    """Minima at -1 and 1 of a tilted double well; the fit is in the worse one."""
    x = X.symbol
    r = cs.vertcat(x[0] ** 2 - 1, 0.3 * (x[0] + 2), x[1] - x[0])
    found = of(r, (1.0, 1.0))
    assert found.best > 0.8
    assert found.lower is not None
    assert found.lower["x"][0] < -0.8
    assert "a lower minimum" in str(found)


def test_bad_entries_and_levels_are_refused() -> None:
    problem = wb.Problem([Residual("r", X.symbol, 1.0)], ["x"], blocks=[X])
    values = {"x": np.zeros(2)}
    with pytest.raises(UnknownName, match=r"x\[0\]"):
        profile_likelihood(problem, values, "x[7]")
    with pytest.raises(BadArgument, match="between 0 and 1, not 2"):
        profile_likelihood(problem, values, "x[0]", level=2)
    with pytest.raises(BadArgument, match="is all that is free"):
        profile_likelihood(problem.freeing("x[0]"), values, "x[0]")


def test_the_command_draws_it(tmp_path: Path) -> None:
    arguments = ["diagnose", "nist-misra1a", "--out", str(tmp_path), "--profile", "b[b1]"]
    result = CliRunner().invoke(app, arguments)
    assert "b[b1] is between" in " ".join(result.output.split())
    folder = tmp_path / "nist-misra1a-diagnosis"
    assert "PROFILES\nb[b1] is between" in (folder / "diagnosis.txt").read_text()
    page = (folder / "index.html").read_text()
    assert "Every point is a fit of all other unknowns" in page
    refused = CliRunner().invoke(app, [*arguments, "--at-start"])
    assert "give it without them" in str(refused.exception) + refused.output
