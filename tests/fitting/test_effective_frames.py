"""What correlated frames are worth, against formulas."""

import numpy as np
import pytest

from workbench.fitting import BadObservation, effective_frames
from workbench.fitting.effective_frames import autocorrelation


def correlated(rho: float, frames: int, series: int, seed: int = 0) -> np.ndarray:
    """AR(1) noise of unit variance, (T, series)."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((frames, series))
    for t in range(1, frames):
        x[t] = rho * x[t - 1] + np.sqrt(1 - rho**2) * x[t]
    return x


def test_white_noise_is_worth_all_frames() -> None:
    x = correlated(0.0, 200, 4000)
    assert effective_frames(x) == pytest.approx(200, rel=0.1)


def test_a_constant_is_worth_one() -> None:
    assert effective_frames(np.full((50, 6), -3.0)) == 1


@pytest.mark.parametrize("rho", [0.3, 0.6, 0.85])
def test_ar1_noise_has_the_known_worth(rho: float) -> None:
    T = 2000
    assert effective_frames(correlated(rho, T, 600)) == pytest.approx(
        T * (1 - rho) / (1 + rho), rel=0.15
    )


def test_a_bias_limits_the_worth() -> None:
    """A constant of variance b beside white noise of variance 1 - b: T / (1 + b (T - 1))."""
    rng, b, T = np.random.default_rng(1), 0.3, 100
    x = np.sqrt(b) * rng.standard_normal(5000) + np.sqrt(1 - b) * correlated(0.0, T, 5000)
    assert effective_frames(x) == pytest.approx(T / (1 + b * (T - 1)), rel=0.05)


def test_the_variance_of_a_mean_is_that_of_so_many_frames() -> None:
    x = correlated(0.8, 100, 5000, seed=2)
    n = effective_frames(x[:, :2500])
    assert x[:, 2500:].mean(axis=0).var() == pytest.approx(1 / n, rel=0.1)


def test_it_is_the_sum_of_the_autocorrelation_over_all_lags() -> None:
    x, T = correlated(0.7, 60, 40, seed=3), 60
    r = autocorrelation(x, np.ones(x.shape, dtype=bool))
    lags = np.arange(1, T)
    products = np.array([np.sum(x[k:] * x[:-k]) / T for k in lags]) / np.mean(x**2) / 40
    assert effective_frames(x) == pytest.approx(T / (1 + 2 * products.sum()))
    assert r[0] == 1
    assert r[1] == pytest.approx(0.7, abs=0.05)


def test_gaps_do_not_count() -> None:
    x = correlated(0.0, 100, 4000)
    known = np.ones(x.shape, dtype=bool)
    known[::2] = False
    x[::2] = np.nan
    assert effective_frames(x, known) == pytest.approx(50, rel=0.1)


def test_what_cannot_be_judged_is_refused() -> None:
    with pytest.raises(BadObservation, match="no landmark was observed in two frames"):
        effective_frames(np.ones((1, 4)))
    with pytest.raises(BadObservation, match="must be finite"):
        effective_frames(np.full((4, 2), np.nan))
    with pytest.raises(BadObservation, match="same shape"):
        effective_frames(np.ones((4, 2)), np.ones((4, 3), dtype=bool))
