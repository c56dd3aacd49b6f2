"""Other minima along weak directions: second wells, valleys, and none."""

from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.fitting import OtherMinima, other_minima
from workbench.residuals import Residual

X = wb.Block("x", (2,))


def of(expression: cs.MX, start: tuple[float, float], directions: int = 2) -> OtherMinima:
    problem = wb.Problem([Residual("r", expression, 1.0)], ["x"])
    values = wb.solve(problem, {"x": np.array(start)}).values
    return other_minima(problem, values, directions=directions)


def wells() -> cs.MX:
    """A double well in x[0], a little lower on the left."""
    return cs.vertcat(X.symbol[0] ** 2 - 0.5, 0.1 * (X.symbol[0] + 2), 3 * X.symbol[1])


def test_a_second_well_is_found_from_either_side() -> None:
    right = of(wells(), (1, 0))
    assert [one.entry for one in right.better] == ["x[0]"]
    assert right.better[0].values["x"][0] == pytest.approx(-0.70, abs=0.03)
    assert "The fit was not at the best minimum." in str(right)
    left = of(wells(), (-1, 0))
    assert not left.better
    assert left.minima[0].excess == pytest.approx(-right.better[0].excess, rel=1e-6)
    assert "above" in str(left)
    assert left.starts == left.came_back + left.minima[0].starts == 8


def test_a_valley_is_told_from_a_minimum() -> None:
    found = of(cs.vertcat(X.symbol[0] - X.symbol[1], 2 * (X.symbol[0] - X.symbol[1])), (0.3, 0.1))
    assert not found.minima
    assert found.valley
    assert all(abs(one.excess) < 1e-6 for one in found.valley)
    assert "where a fit ends in it is arbitrary" in str(found)


def test_one_minimum_is_said_to_be_the_only_one_found() -> None:
    found = of(cs.vertcat(X.symbol[0] - 1, X.symbol[1] + 2), (0, 0))
    assert found.came_back == found.starts == 8
    assert "No other minimum was found this way." in str(found)


def test_starts_stay_between_bounds() -> None:
    problem = wb.Problem([Residual("r", wells(), 1.0)], ["x"], bounds={"x[0]": (0.1, 2.0)})
    values = wb.solve(problem, {"x": np.array([1.0, 0.0])}).values
    found = other_minima(problem, values, directions=2)
    assert all(0.1 <= one.values["x"][0] <= 2.0 for one in (*found.minima, *found.valley))
    with pytest.raises(BadArgument, match="one direction or more"):
        other_minima(problem, values, directions=0)


def test_the_command_says_it(tmp_path: Path) -> None:
    arguments = ["diagnose", "nist-misra1a", "--out", str(tmp_path), "--minima", "2"]
    result = CliRunner().invoke(app, arguments)
    told = " ".join(result.output.split())
    assert "Of 8 fits from starts on both sides along the 2 weakest directions" in told
    refused = CliRunner().invoke(app, [*arguments, "--data-alone"])
    assert "--minima begins at the minimum" in str(refused.exception) + refused.output
