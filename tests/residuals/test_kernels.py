"""Robust kernels of rows and of norms, and the weights outside of them."""

from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.tiers import few
from workbench import Block, Camera, Problem, Residual, Status, residuals, solve
from workbench.errors import BadResidual, NotNumbers
from workbench.residuals import Kernel, geman_mcclure, huber, of_norms, quadratic

KERNELS = {"quadratic": quadratic, "geman-mcclure": geman_mcclure, "huber": huber(0.7)}
EACH_KERNEL = pytest.mark.parametrize(
    "kernel",
    few(
        [pytest.param(kernel, id=name) for name, kernel in KERNELS.items()],
        ("geman-mcclure", "huber"),
    ),
)


def rho(kernel: Kernel, sigma: float = 1.0) -> cs.Function:
    """x -> rho(x^2 / sigma^2), its slope and its curvature in x."""
    x = Block("x").symbol
    square = Residual("x", x, sigma, kernel=kernel).whitened ** 2
    slope = cs.gradient(square, x)
    return cs.Function("rho", [x], [square, slope, cs.gradient(slope, x)])


def test_geman_mcclure_is_half_at_sigma_and_never_one() -> None:
    at_sigma = float(rho(geman_mcclure, sigma=0.3)(0.3)[0])
    assert at_sigma == pytest.approx(0.5, rel=1e-15)
    assert 0.9999 < float(rho(geman_mcclure)(1e3)[0]) < 1
    x = 2.5
    assert float(rho(geman_mcclure, 0.5)(x)[0]) == pytest.approx(x**2 / (0.25 + x**2))


def test_huber_is_linear_beyond_its_threshold() -> None:
    for threshold in [0.5, 1.345]:
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


ROBUST = {name: kernel for name, kernel in KERNELS.items() if name != "quadratic"}
EACH_ROBUST = pytest.mark.parametrize("kernel", ROBUST.values(), ids=list(ROBUST))
SEEN = np.random.default_rng(0).normal(size=(7, 3))  # m
AT = SEEN + np.linspace(0.1, 2.0, 7)[:, None] * np.random.default_rng(1).normal(size=(7, 3))
WIDTH = 0.8  # m: some of them are outliers and some are not
POINTS = Block("points", (7, 3), "m")
K = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]


def cost_of_points(
    kernel: Kernel, at: np.ndarray, seen: np.ndarray = SEEN, **further: Any
) -> float:
    term = Residual(
        "points",
        cs.vec(POINTS.symbol - cs.DM(seen.T)),
        WIDTH,
        "m",
        kernel,
        rows_per_point=3,
        **further,
    )
    return Problem([term], "points").linearize({"points": at}).cost


def rho_of(kernel: Kernel, s: np.ndarray) -> np.ndarray:
    """rho(s) of numbers, by the factor that a kernel is."""
    x = cs.MX.sym("x", len(s))
    return np.asarray(cs.Function("rho_of", [x], [kernel(x) ** 2 * x])(s)).ravel()


@EACH_KERNEL
def test_cost_is_half_of_rho_of_squared_distances(kernel: Kernel) -> None:
    s = np.sum((AT - SEEN) ** 2, axis=1) / WIDTH**2
    assert s.min() < 0.7**2 < s.max() or kernel is quadratic  # both sides of Huber's border
    assert cost_of_points(of_norms(kernel), AT) == pytest.approx(
        0.5 * rho_of(kernel, s).sum(), rel=1e-13
    )
    trust = np.random.default_rng(2).uniform(0.0, 2.0, 7)
    weighed = cost_of_points(of_norms(kernel), AT, weights=trust)
    assert weighed == pytest.approx(0.5 * trust @ rho_of(kernel, s), rel=1e-13)


@EACH_ROBUST
def test_kernel_of_norms_is_rotation_invariant(kernel: Kernel) -> None:
    R = Rotation.from_rotvec([0.4, -0.9, 0.6]).as_matrix()
    norms, rows = of_norms(kernel), kernel
    assert cost_of_points(norms, AT @ R.T, SEEN @ R.T) == pytest.approx(
        cost_of_points(norms, AT), rel=1e-13
    )
    assert abs(cost_of_points(rows, AT @ R.T, SEEN @ R.T) / cost_of_points(rows, AT) - 1) > 1e-3


def test_bad_points_of_norms_are_refused() -> None:
    for further, text in [
        ({"rows_per_point": 1}, "rows_per_point=3"),
        ({"rows_per_point": 4}, "no points of 4 rows"),
        ({"weights": cs.MX.sym("w", 21)}, "a point has one weight"),
        ({"sigma": np.ones(3)}, r"row \(21\) or point \(7\)"),
    ]:
        given = {"sigma": 1.0, "kernel": of_norms(huber()), "rows_per_point": 3} | further
        with pytest.raises(BadResidual, match=text):
            Residual("points", cs.vec(POINTS.symbol), **given)


def test_of_norms_needs_a_kernel_of_numbers() -> None:
    for kernel in ["huber", of_norms(huber())]:
        with pytest.raises(BadResidual, match="of_norms takes a kernel of single numbers"):
            of_norms(kernel)


def cost_of_keypoints(off: float, confidence: Any, kernel: Kernel, count: int = 24) -> float:
    """24 keypoints, each `off` sigmas away in u and in v."""
    points, camera = Block("points", (count, 3), "m"), Camera()
    values = camera.values(K=K, t=(0, 0, 3.0))
    values |= {"points": 0.3 * np.random.default_rng(0).normal(size=(count, 3))}
    seen = camera.pixels(values["points"], values) + 5.0 * off
    term = residuals.keypoints(points.symbol, camera, seen, confidence, sigma=5.0, kernel=kernel)
    return Problem([term], "points").linearize(values).cost


def test_weights_stand_outside_of_kernels() -> None:
    # 48 coordinates at ten sigmas: rho is 100 / 101 of each, and a tenth of that is counted;
    # a weight inside of the kernel would bring them to one sigma, where rho is 1/2: 12.0
    cost = cost_of_keypoints(10.0, np.full(24, 0.1), geman_mcclure)
    assert cost == pytest.approx(0.5 * 48 * 0.1 * 100 / 101, rel=1e-12)  # 2.376
    assert round(cost, 2) == 2.38


@EACH_KERNEL
def test_weight_of_two_counts_as_two_rows(kernel: Kernel) -> None:
    x = Block("x", (3,))
    at = {"x": np.array([0.3, -5.0, 2.0])}
    twice = [Residual(name, x.symbol, 0.5, kernel=kernel) for name in ("a", "b")]
    weighted = Residual("a", x.symbol, 0.5, kernel=kernel, weights=2.0)
    rows = Residual("a", x.symbol, 0.5, kernel=kernel, weights=np.full(3, 2.0))
    here = Problem(twice, "x").linearize(at)
    for term in (weighted, rows):
        there = Problem([term], "x").linearize(at)
        assert there.cost == pytest.approx(here.cost, rel=1e-14)
        np.testing.assert_allclose(there.gradient, here.gradient, rtol=1e-13)
        np.testing.assert_allclose(there.normal, here.normal, rtol=1e-13)


def test_weight_of_zero_has_finite_derivatives() -> None:
    """The root has no derivative at zero; a fixed block of weights may hold zeros all the same."""
    x, w = Block("x", (2,)), Block("w", (2,))
    problem = Problem([Residual("r", x.symbol, 1.0, weights=w.symbol)], "x")
    values = {"x": np.array([3.0, 4.0]), "w": np.array([0.0, 0.25])}
    here = problem.linearize(values)
    np.testing.assert_array_equal(here.residual, [0.0, 2.0])
    np.testing.assert_array_equal(here.jacobian, np.diag([0.0, 0.5]))
    solution = solve(problem, values)  # measures rounding through the derivative by w as well
    assert solution.status is Status.CONVERGED
    assert solution.values["x"][1] == pytest.approx(0, abs=1e-9)
    assert problem.residuals[0].reads == ("x", "w")
    assert Problem(problem.residuals, ("x", "w")).linearize(values).finite
    # a weight below zero is no weight: nothing goes on as if it were one
    assert not problem.linearize(values | {"w": np.array([-1.0, 1.0])}).finite


def test_bad_weights_are_refused() -> None:
    for weights, text in [
        (-1.0, "finite weights from 0 on, not -1"),
        (np.ones(2), r"one weight or 3 of them, not an array of shape \(2,\)"),
        (cs.MX(cs.DM([1, -2, 1])), "finite weights from 0 on, not -2"),
    ]:
        with pytest.raises(BadResidual, match=f"residual 'r' needs {text}"):
            Residual("r", Block("x", (3,)).symbol, 1.0, weights=weights)
        with pytest.raises(NotNumbers, match=r"the weights of residual 'r' must be .*, not text"):
            Residual("r", Block("x", (3,)).symbol, 1.0, weights="heavy")
