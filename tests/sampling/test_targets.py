"""Draws from posteriors that are known; and the verdict on those that are hard."""

import numpy as np
import pytest
import scipy.stats

from tests.sampling.densities import bounded, conditioned, gaussian, rosenbrock, two_modes
from workbench.sampling import Posterior, Usability, sample


def within_bands(posterior: Posterior, mean: np.ndarray, covariance: np.ndarray) -> None:
    """Mean and covariance within simultaneous 99.9 % bands, at the effective number of draws.

    In coordinates in which the truth is a standard normal: each entry of the mean has the error
    1 / sqrt(n), a variance sqrt(2 / n), a covariance 1 / sqrt(n) (Bonferroni over all of them).
    """
    k, n = posterior.size, posterior.mixing.effective.min()
    W = np.linalg.inv(np.linalg.cholesky(covariance))
    z = (posterior.flat - mean) @ W.T
    limit = scipy.stats.norm.isf(0.0005 / (k + k * (k + 1) / 2))
    assert np.abs(z.mean(axis=0)).max() < limit / np.sqrt(n)
    error = np.cov(z.T) - np.eye(k)
    assert np.abs(np.diag(error)).max() < limit * np.sqrt(2 / n)
    assert np.abs(error - np.diag(np.diag(error))).max() < limit / np.sqrt(n)


@pytest.mark.parametrize(
    ("k", "condition"),
    [(3, 1.0), (3, 1e6), (10, 1e6), pytest.param(20, 1e6, marks=pytest.mark.thorough)],
)
def test_gaussians(k: int, condition: float) -> None:
    C, mean = conditioned(k, condition), np.arange(k) - 2.0
    problem = gaussian(C, mean)
    posterior = sample(problem, {"x": mean}, steps=10_000, seed=1)
    assert posterior.mixing.verdict is Usability.USABLE, posterior.verdict
    assert posterior.mixing.effective.min() > 3000
    within_bands(posterior, mean, C)


def test_a_bounded_gaussian() -> None:
    posterior = sample(bounded(), {"x": [1.5, 0.0]}, steps=4000, seed=2)
    assert posterior.usable, posterior.verdict
    assert posterior.flat[:, 0].min() >= 1.0
    n = posterior.mixing.effective.min()
    truth = scipy.stats.truncnorm(1, np.inf)
    assert posterior.mean[0] == pytest.approx(truth.mean(), abs=4 * truth.std() / np.sqrt(n))
    assert posterior.sd[0] == pytest.approx(truth.std(), rel=4 / np.sqrt(n))
    assert posterior.sd[1] == pytest.approx(1.0, rel=4 / np.sqrt(n))


def test_a_start_on_the_bound_is_no_obstacle() -> None:
    posterior = sample(bounded(), {"x": [1.0, 0.0]}, steps=1600, seed=2)
    assert posterior.usable, posterior.verdict


def test_rosenbrock_is_believed_only_when_it_is_right() -> None:
    at = {"x": [1.0, 1.0]}
    for hard in (10.0, 1.0):
        short = sample(rosenbrock(hard), at, steps=300, seed=3)
        assert not short.usable
    posterior = sample(rosenbrock(0.3), at, steps=16_000, walkers=16, seed=3)
    assert posterior.usable, posterior.verdict
    error = np.abs(posterior.mean - [1.0, 1.3]) / np.sqrt([0.3, 1.48])
    assert error.max() < 4 / np.sqrt(posterior.mixing.effective.min())


def test_two_modes_near_each_other_are_mixed() -> None:
    posterior = sample(two_modes(3.0), {"x": [3.0, 0.0]}, steps=8000, seed=4)
    assert len(posterior.modes) == 2
    assert posterior.usable, posterior.verdict
    share = np.mean(posterior.flat[:, 0] > 0)
    assert share == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(posterior.mixing.effective.min()))


def test_two_modes_that_no_move_joins_are_not_called_usable() -> None:
    from workbench.sampling.moves import stretch

    posterior = sample(two_modes(12.0), {"x": [12.0, 0.0]}, steps=2000, seed=4, moves=stretch())
    assert posterior.mixing.verdict is Usability.NOT_MIXING, posterior.verdict
    assert "NOT CONVERGED" in str(posterior)
    assert "95 %" not in str(posterior)  # no interval without a verdict that carries it


def test_too_short_is_said_with_what_would_do() -> None:
    posterior = sample(gaussian(np.eye(20)), {"x": np.zeros(20)}, steps=300, seed=5)
    assert posterior.mixing.verdict is not Usability.USABLE
    assert "take" in posterior.verdict or "fewer" in posterior.verdict


def test_85_dimensions_are_not_called_converged() -> None:
    posterior = sample(gaussian(np.eye(85)), {"x": np.zeros(85)}, steps=100, seed=5)
    assert not posterior.usable
    assert str(posterior).startswith("NOT CONVERGED")


def test_three_ensembles_vouch_for_nothing() -> None:
    posterior = sample(
        gaussian(np.eye(2)), {"x": np.zeros(2)}, steps=1000, walkers=16, ensembles=3, seed=5
    )
    assert posterior.mixing.verdict is Usability.TOO_SHORT
    assert "at least 4" in posterior.verdict
