"""Robust kernels: their values, their pull, and where they stop pulling."""

import casadi as cs
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from workbench import Block, Residual
from workbench.residuals import Kernel, geman_mcclure, huber, quadratic

ALL = {"quadratic": quadratic, "geman-mcclure": geman_mcclure, "huber": huber()}
EACH = pytest.mark.parametrize("kernel", ALL.values(), ids=list(ALL))


def rho(kernel: Kernel, sigma: float = 1.0) -> cs.Function:
    """x -> rho(x^2 / sigma^2), its slope and its curvature in x."""
    x = Block("x").symbol
    square = Residual("x", x, sigma, kernel=kernel).whitened ** 2
    slope = cs.gradient(square, x)
    return cs.Function("rho", [x], [square, slope, cs.gradient(slope, x)])


@EACH
def test_small_residuals_keep_their_sigma(kernel: Kernel) -> None:
    value, slope, curvature = (float(out) for out in rho(kernel, sigma=0.5)(0.0))
    assert (value, slope) == (0, 0)
    assert curvature == pytest.approx(2 / 0.5**2, rel=1e-15)  # rho(s) ~ s, s = x^2 / sigma^2
    for x in (1e-3, -1e-3):
        assert float(rho(kernel)(x)[0]) == pytest.approx(x**2, rel=2e-6)  # to order x^2


@EACH
def test_rho_is_even_and_grows_with_the_residual(kernel: Kernel) -> None:
    x = np.linspace(0, 30, 301)
    values = np.array([float(rho(kernel)(v)[0]) for v in x])
    mirrored = np.array([float(rho(kernel)(-v)[0]) for v in x])
    np.testing.assert_array_equal(values, mirrored)
    assert (np.diff(values) > 0).all()
    assert (values <= x**2 * (1 + 1e-15)).all()


def test_geman_mcclure_is_half_at_sigma_and_never_one() -> None:
    at_sigma = float(rho(geman_mcclure, sigma=0.3)(0.3)[0])
    assert at_sigma == pytest.approx(0.5, rel=1e-15)
    assert 0.9999 < float(rho(geman_mcclure)(1e3)[0]) < 1
    x = 2.5
    assert float(rho(geman_mcclure, 0.5)(x)[0]) == pytest.approx(x**2 / (0.25 + x**2))


@pytest.mark.parametrize("sigma", [0.1, 1.0, 100.0])
def test_geman_mcclure_pulls_hardest_at_sigma_over_root_three(sigma: float) -> None:
    f = rho(geman_mcclure, sigma)
    peak = minimize_scalar(
        lambda x: -float(f(x)[1]), bounds=(0, 3 * sigma), options={"xatol": 1e-9 * sigma}
    )
    assert peak.x == pytest.approx(sigma / np.sqrt(3), rel=1e-6)
    assert -peak.fun == pytest.approx(9 / (8 * np.sqrt(3)) / sigma, rel=1e-12)  # 0.6495 / sigma
    assert abs(float(f(sigma / np.sqrt(3))[2])) < 1e-12 / sigma**2


@pytest.mark.parametrize("threshold", [0.5, 1.345, 4.0])
def test_huber_is_linear_beyond_its_threshold_and_smooth_there(threshold: float) -> None:
    f = rho(huber(threshold))
    inside, outside = threshold * (1 - 1e-12), threshold * (1 + 1e-12)
    for below, above in zip(f(inside)[:2], f(outside)[:2], strict=True):
        assert float(below) == pytest.approx(float(above), rel=1e-11)
    assert float(f(0.9 * threshold)[0]) == pytest.approx((0.9 * threshold) ** 2, rel=1e-15)
    for x in (1.1, 2.0, 50.0):
        value, slope, curvature = (float(out) for out in f(x * threshold))
        assert value == pytest.approx(threshold**2 * (2 * x - 1), rel=1e-14)
        assert slope == pytest.approx(2 * threshold, rel=1e-13)
        assert abs(curvature) < 1e-12


@EACH
def test_a_column_is_shrunk_row_by_row(kernel: Kernel) -> None:
    x = Block("x", (4,)).symbol
    sigma = np.array([1.0, 2.0, 0.5, 1.0])
    whitened = cs.Function("f", [x], [Residual("x", x, sigma, kernel=kernel).whitened])
    numbers = np.array([0.3, -5.0, 2.0, 0.0])
    for i, value in enumerate(np.asarray(whitened(numbers)).ravel()):
        assert value**2 == pytest.approx(float(rho(kernel, sigma[i])(numbers[i])[0]), abs=1e-15)
        assert np.sign(value) == np.sign(numbers[i])
