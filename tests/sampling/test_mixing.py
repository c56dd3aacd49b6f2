"""What is said of chains, against chains of which all is known."""

import numpy as np
import pytest
import scipy.signal

from workbench.sampling.mixing import (
    Mixing,
    Usability,
    integrated_time,
    potential_scale,
)


def autoregressive(rho: float, shape: tuple[int, int, int], seed: int = 0) -> np.ndarray:
    """x_t = rho x_{t-1} + sqrt(1 - rho^2) e_t, in equilibrium: tau = (1 + rho) / (1 - rho)."""
    rng = np.random.default_rng(seed)
    E, S, W = shape
    noise = rng.standard_normal((E, S + 2000, W)) * np.sqrt(1 - rho**2)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -rho], noise, axis=1))[:, 2000:]


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_time_of_autoregressive_chains(rho: float) -> None:
    draws = autoregressive(rho, (4, 8000, 16))
    assert integrated_time(draws) == pytest.approx((1 + rho) / (1 - rho), rel=0.05)


def test_potential_scale_is_that_of_arviz() -> None:
    draws = autoregressive(0.9, (4, 500, 1))
    draws[0] *= 1.3  # wider
    draws[1] += 0.2  # elsewhere
    assert potential_scale(draws) == pytest.approx(1.03636726, rel=1e-6)  # by ArviZ 0.23


def mixing(draws: np.ndarray, acceptance: float = 0.3) -> Mixing:
    return Mixing(("a",), draws[..., None], acceptance, 0)


def test_long_chains_are_usable_and_short_ones_not() -> None:
    assert mixing(autoregressive(0.9, (4, 4000, 8))).verdict is Usability.USABLE
    assert mixing(autoregressive(0.9, (4, 300, 8))).verdict is Usability.TOO_SHORT
    assert mixing(autoregressive(0.9999, (4, 2000, 8))).verdict is Usability.NOT_MIXING


def test_many_effective_draws_in_few_steps_are_usable() -> None:
    """8,000 effective draws of 64 walkers in 31 times of a memory that has settled."""
    draws = autoregressive(0.9, (4, 600, 64))
    found = mixing(draws)
    assert 20 < found.length < 50
    assert found.effective.min() > 7500
    assert found.scales.max() < 1.001
    assert found.growth < 1.2
    assert found.verdict is Usability.USABLE, str(found)
    few = mixing(autoregressive(0.9, (4, 300, 64)))  # as many walkers, but 16 times
    assert few.effective.min() > 4000
    assert few.verdict is Usability.TOO_SHORT
    assert "below 20 not even that time can be believed" in str(few)


def test_growing_memory_is_not_believed() -> None:
    """What is slow beside the length of a chain shows only in the second half."""
    rng = np.random.default_rng(0)
    draws = autoregressive(0.9, (4, 600, 64))
    draws[:, 300:] += 0.7 * rng.standard_normal((4, 1, 64))  # walkers that settle apart, late
    found = mixing(draws)
    assert found.growth > 1.2
    assert found.verdict is not Usability.USABLE


def test_walkers_that_stay_have_endless_memory() -> None:
    draws = autoregressive(0.5, (4, 3000, 8))
    draws[:, :, ::2] += 8.0  # half of them in another mode, for ever
    judged = mixing(draws)
    assert judged.verdict is not Usability.USABLE
    assert judged.times.max() > 500


def test_disagreeing_ensembles_are_not_mixed() -> None:
    draws = autoregressive(0.5, (4, 3000, 8))
    draws[0] += 1.0
    assert mixing(draws).verdict is Usability.NOT_MIXING
    assert "different places" in str(mixing(draws))
    assert "The quantiles of single ensembles (5 to 95 %) are within 0.58" in str(mixing(draws))
    slightly = autoregressive(0.5, (4, 3000, 8))
    slightly[0] += 0.08  # far less than R-hat notices
    assert mixing(slightly).scales.max() < 1.01
    assert mixing(slightly).verdict is Usability.NOT_MIXING


def test_stuck_walkers_and_rejected_proposals_are_seen() -> None:
    draws = autoregressive(0.5, (4, 3000, 8))
    draws[2, 1000:, 3] = 0.1
    assert mixing(draws).stuck == 1
    assert "did not move" in str(mixing(draws))
    refused = str(mixing(autoregressive(0.5, (4, 3000, 8)), acceptance=0.003))
    assert "accepted" in refused
    assert "fewer entries" not in refused  # than one
