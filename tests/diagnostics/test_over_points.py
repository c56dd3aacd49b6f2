"""Diagnoses at many points: what is null everywhere and somewhere, and draws of priors."""

from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from workbench.cli.app import app
from workbench.diagnostics import diagnose_over, prior_draws
from workbench.errors import BadArgument, UnknownName
from workbench.residuals import Residual, gaussian


def crane() -> tuple[wb.Problem, list[wb.Values]]:
    """The heights of a boom of two links, and the sum of two weights, of which neither is seen.

    Stretched upwards, heights do not notice small turns.
    """
    angles, weights = wb.Block("angles", (2,), "rad"), wb.Block("weights", (2,))
    a = angles.symbol
    heights = cs.vertcat(cs.cos(a[0]), cs.cos(a[0]) + cs.cos(a[0] + a[1]))
    seen = Residual("heights", heights, 0.01)
    weighed = Residual("scales", cs.sum1(weights.symbol) - 1, 0.01)
    problem = wb.Problem([seen, weighed], ["angles", "weights"])
    points: list[wb.Values] = [
        {"angles": np.array(each), "weights": np.zeros(2)}
        for each in ([0.0, 0.0], [0.5, 0.3], [0.0, 0.6], [1.0, -0.2])
    ]
    return problem, points


def test_ranks_and_names_are_counted_over_points() -> None:
    over = diagnose_over(*crane())
    assert over.ranks.tolist() == [1, 3, 2, 3]
    assert [one.name for one in over.everywhere] == ["a trade-off within weights"]
    some = {one.name: one.count for one in over.somewhere}
    assert some["angles[0]"] == 1
    assert "a trade-off within weights" not in some
    told = over.report()
    assert "rank 1 at 1, 2 at 1, 3 at 2 of them; 4 would be full" in told
    assert "null at every point\n  a trade-off within weights" in told
    assert "angles[0]: at 1 of 4 points" in told


def test_no_points_are_refused() -> None:
    with pytest.raises(BadArgument, match="no point to diagnose at"):
        diagnose_over(crane()[0], [])


def test_draws_of_a_gaussian_prior_have_its_mean_and_covariance() -> None:
    x, y = wb.Block("x", (2,)), wb.Block("y", (1,))
    C = np.array([[0.5, 0.3], [0.3, 0.4]])
    prior = gaussian(x.symbol, mean=[1.0, -2.0], covariance=C, name="prior")
    data = Residual("data", x.symbol[0] + y.symbol, 1.0)
    problem = wb.Problem([prior, data], ["x", "y"])
    count = 4000
    draws = prior_draws(problem, {"x": [3.0, 3.0], "y": [7.0]}, "prior", count, seed=1)
    drawn = np.array([draw["x"] for draw in draws])
    assert np.abs(drawn.mean(axis=0) - [1, -2]).max() < 4 * np.sqrt(0.5 / count)
    assert np.abs(np.cov(drawn.T) - C).max() < 4 * np.sqrt(2 * 0.5**2 / count)
    assert all(draw["y"] == [7.0] for draw in draws)  # the prior says nothing of it


def test_priors_must_be_named() -> None:
    problem, points = crane()
    with pytest.raises(BadArgument, match="name of one or more residuals"):
        prior_draws(problem, points[0], (), 3)
    with pytest.raises(UnknownName):
        prior_draws(problem, points[0], "heigths", 3)


def test_the_command_takes_draws_of_priors_that_are_named(tmp_path: Path) -> None:
    bad = CliRunner().invoke(app, ["diagnose", "balance-monocular", "--draws", "-1"])
    assert bad.exit_code == 2
    none = CliRunner().invoke(
        app, ["diagnose", "nist-misra1a", "--draws", "2", "--out", str(tmp_path)]
    )
    assert "names no residual as one" in " ".join((str(none.exception) + none.output).split())
