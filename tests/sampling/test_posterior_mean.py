"""The mean of a posterior: known means are found, within the error that is told."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.residuals import Residual
from workbench.sampling import Improper, posterior_mean

X = wb.Block("x", (2,), "m")
A = np.array([[2.0, 0.3], [0.0, 0.5], [1.0, 1.0]])
b = np.array([1.0, -0.5, 0.2])
LINEAR = wb.Problem([Residual("line", cs.DM(A) @ X.symbol - cs.DM(b), 1.0)], ["x"])
SKEWED = wb.Problem(
    [Residual("skewed", cs.if_else(X.symbol < 0, 4 * X.symbol, X.symbol), 1.0)], ["x"]
)


def test_mean_and_mode_of_a_normal_distribution_are_one() -> None:
    mode, *_ = np.linalg.lstsq(A, b, rcond=None)
    found = posterior_mean(LINEAR, {"x": mode}, chains=32, trajectories=100)
    sd = np.sqrt(np.diag(np.linalg.inv(A.T @ A)))
    np.testing.assert_allclose(found.sd, sd, rtol=0.1)
    assert (found.error < 0.05 * sd).all()
    assert (abs(found.values["x"] - mode) < 4 * found.error).all()
    assert 0.5 < found.accepted <= 1
    assert found.draws.shape == (3200, 2)


def test_the_mean_of_a_skewed_density_is_not_its_mode() -> None:
    """exp(-x^2 / 2) on the right and exp(-8 x^2) on the left of zero, in two numbers."""
    found = posterior_mean(SKEWED, {"x": np.zeros(2)}, chains=32, trajectories=100)
    mean = np.sqrt(2 / np.pi) * (1 - 1 / 4)
    assert (abs(found.values["x"] - mean) < 4 * found.error).all()
    assert (found.error < 0.05).all()
    few, again, other = (posterior_mean(SKEWED, {"x": np.zeros(2)}, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(few.draws, again.draws)
    assert (few.draws != other.draws).any()
    assert (abs(few.values["x"] - mean) < 5 * few.error).all()


def test_bounds_cut_the_density_off() -> None:
    ahead = wb.Problem([Residual("ahead", X.symbol, 1.0)], ["x"], bounds={"x": (0.0, np.inf)})
    found = posterior_mean(ahead, {"x": np.zeros(2)}, chains=32, trajectories=100)
    assert (abs(found.values["x"] - np.sqrt(2 / np.pi)) < 4 * found.error).all()
    assert (found.draws >= 0).all()


def test_what_has_no_mean_is_refused() -> None:
    with pytest.raises(BadArgument, match="`chains` must be 2 or more, not 1"):
        posterior_mean(LINEAR, {"x": np.zeros(2)}, chains=1)
    with pytest.raises(BadArgument, match="`trajectories` must be 1 or more, not 0"):
        posterior_mean(LINEAR, {"x": np.zeros(2)}, trajectories=0)
    open_ended = wb.Problem([Residual("one", X.symbol[:1], 1.0)], ["x"])
    with pytest.raises(Improper, match="x"):
        posterior_mean(open_ended, {"x": np.zeros(2)})
    held = wb.Problem([Residual("x", X.symbol, 1.0)], ["x"], bounds={"x": ([0, 1], [2, 1])})
    with pytest.raises(BadArgument, match=r"x\[1\] has equal bounds"):
        posterior_mean(held, {"x": np.ones(2)})
