"""What a distance costs and how much it pulls."""

import numpy as np
import pytest

from workbench.errors import BadArgument
from workbench.registration import GemanMcClure, LeastSquares, Trimmed
from workbench.registration.icp_losses import Loss

D = np.array([0.0, 1e-3, 0.01, 0.03, 0.2, 4.0])
SMOOTH = pytest.mark.parametrize("loss", [LeastSquares(), GemanMcClure(0.02)], ids=str)


@SMOOTH
def test_a_weight_is_the_slope_of_the_cost_over_the_distance(loss: Loss) -> None:
    h = 1e-7
    slope = (loss.costs(D[1:] + h) - loss.costs(D[1:] - h)) / (2 * h)
    np.testing.assert_allclose(loss.weights(D)[1:] * D[1:], slope, atol=1e-9, rtol=1e-6)
    assert loss.weights(D)[0] == 1


@pytest.mark.parametrize("loss", [LeastSquares(), GemanMcClure(0.02), Trimmed(0.5)], ids=str)
def test_weighted_squares_lie_above_the_loss_and_touch_it(loss: Loss) -> None:
    """Why a step that lowers the weighted squares lowers the loss."""
    rng = np.random.default_rng(0)
    here = rng.exponential(0.05, 50)
    weights, cost = loss.weights(here), loss.costs(here).sum()
    for _ in range(200):
        there = here * rng.exponential(1.0, 50)
        assert loss.costs(there).sum() <= cost + weights @ (there**2 - here**2) / 2 + 1e-15


def test_known_values() -> None:
    robust = GemanMcClure(0.02)
    np.testing.assert_allclose(robust.costs(np.array([0.02, 1e6])), [1e-4, 2e-4], rtol=1e-6)
    assert robust.weights(np.array([0.02])) == pytest.approx([0.25])
    np.testing.assert_array_equal(Trimmed(0.5).weights(D[::-1]), [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(Trimmed(1e-9).weights(D), [1, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(Trimmed(1.0).costs(D), LeastSquares().costs(D))


@pytest.mark.parametrize("scale", [0, -1.0, np.nan, np.inf])
def test_a_scale_is_above_zero(scale: float) -> None:
    with pytest.raises(BadArgument, match="must be above 0 m"):
        GemanMcClure(scale)


@pytest.mark.parametrize("share", [0, -1.0, np.nan, 1.01])
def test_a_share_is_at_most_one(share: float) -> None:
    with pytest.raises(BadArgument, match="above 0 and at most 1"):
        Trimmed(share)
