"""Weights stand outside of kernels: w rho(r), as in the sources, and not rho(w r)."""

from typing import Any

import casadi as cs
import numpy as np
import pytest

from workbench import Block, Camera, Problem, Residual, Status, residuals, solve
from workbench.bodies.catalogue import load_body
from workbench.errors import BadResidual, NotNumbers
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.observations import Observations, photograph
from workbench.residuals import Kernel, geman_mcclure, huber, quadratic
from workbench.training.poses import EdgeTerm, VertexTerm

KERNELS: dict[str, Kernel] = {
    "quadratic": quadratic,
    "geman-mcclure": geman_mcclure,
    "huber": huber(0.7),
}
EACH_KERNEL = pytest.mark.parametrize("kernel", KERNELS.values(), ids=list(KERNELS))
K = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]


def cost_of_keypoints(off: float, confidence: Any, kernel: Kernel, count: int = 24) -> float:
    """24 keypoints, each `off` sigmas away in u and in v."""
    points, camera = Block("points", (count, 3), "m"), Camera()
    values = camera.values(K=K, t=(0, 0, 3.0))
    values |= {"points": 0.3 * np.random.default_rng(0).normal(size=(count, 3))}
    seen = camera.pixels(values["points"], values) + 5.0 * off
    term = residuals.keypoints(points.symbol, camera, seen, confidence, sigma=5.0, kernel=kernel)
    return Problem([term], "points").linearize(values).cost


def test_a_doubtful_outlier_counts_a_tenth_and_stays_an_outlier() -> None:
    # 48 coordinates at ten sigmas: rho is 100 / 101 of each, and a tenth of that is counted;
    # a weight inside of the kernel would bring them to one sigma, where rho is 1/2: 12.0
    cost = cost_of_keypoints(10.0, np.full(24, 0.1), geman_mcclure)
    assert cost == pytest.approx(0.5 * 48 * 0.1 * 100 / 101, rel=1e-12)  # 2.376
    assert round(cost, 2) == 2.38


@EACH_KERNEL
@pytest.mark.parametrize("off", [0.1, 1.0, 10.0])
def test_the_cost_is_linear_in_the_confidence(kernel: Kernel, off: float) -> None:
    whole = cost_of_keypoints(off, np.ones(24), kernel)
    for confidence in (0.1, 0.5, 2.0):
        part = cost_of_keypoints(off, np.full(24, confidence), kernel)
        assert part == pytest.approx(confidence * whole, rel=1e-12)


@EACH_KERNEL
def test_a_row_of_weight_two_counts_as_two_rows(kernel: Kernel) -> None:
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


@EACH_KERNEL
def test_edges_are_weighted_outside_of_the_kernel_too(kernel: Kernel) -> None:
    points = Block("points", (4, 3), "m")
    rng = np.random.default_rng(0)
    at, seen = {"points": rng.normal(size=(4, 3))}, rng.normal(size=(4, 3))
    pairs, trust = [[0, 1], [2, 3], [1, 2]], np.array([0.1, 0.5, 0.0])

    def cost(pairs: Any, confidence: Any) -> float:
        term = residuals.edges(
            points.symbol, seen, pairs, sigma=0.1, confidence=confidence, kernel=kernel
        )
        return Problem([term], "points").linearize(at).cost

    expected = sum(w * cost([pair], None) for w, pair in zip(trust, pairs, strict=True))
    assert cost(pairs, trust) == pytest.approx(expected, rel=1e-12)


def test_a_weight_of_zero_is_silent_in_every_derivative() -> None:
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
    assert Problem(problem.residuals, ("x", "w")).linearize(values).finite
    # a weight below zero is no weight: nothing goes on as if it were one
    assert not problem.linearize(values | {"w": np.array([-1.0, 1.0])}).finite


def test_weights_that_are_symbols_are_read() -> None:
    x, w = Block("x", (2,)), Block("w", (2,))
    assert Residual("r", x.symbol, 1.0, weights=w.symbol).reads == ("x", "w")


@pytest.mark.parametrize(
    ("weights", "text"),
    [
        (-1.0, "finite weights from 0 on, not -1"),
        (np.array([1.0, np.nan, 1.0]), "finite weights from 0 on, not nan"),
        (np.ones(2), r"one weight or 3 of them, not an array of shape \(2,\)"),
        (cs.MX.sym("w", 1, 3), r"one weight or 3 of them, not an array of shape \(1, 3\)"),
        (cs.MX(cs.DM([1, -2, 1])), "finite weights from 0 on, not -2"),
    ],
)
def test_weights_that_are_none_are_refused(weights: Any, text: str) -> None:
    with pytest.raises(BadResidual, match=f"residual 'r' needs {text}"):
        Residual("r", Block("x", (3,)).symbol, 1.0, weights=weights)
    with pytest.raises(NotNumbers, match=r"the weights of residual 'r' must be .*, not text"):
        Residual("r", Block("x", (3,)).symbol, 1.0, weights="heavy")


def test_confidences_below_zero_are_refused() -> None:
    with pytest.raises(BadResidual, match=r"finite weights from 0 on, not -0\.5"):
        cost_of_keypoints(1.0, np.full(24, -0.5), quadratic)


def test_a_detectors_confidence_divides_sigma_where_nothing_is_robust() -> None:
    """A fit squares it: half the confidence is twice the sigma, and a quarter of the cost."""
    body = load_body("small")
    names = body.joint_names
    pixels = np.random.default_rng(0).uniform(100, 500, (len(names), 2))
    costs = {}
    for kernel in (quadratic, geman_mcclure):
        for confidence in (1.0, 0.5):
            seen = np.column_stack([pixels, np.full(len(names), confidence)])
            photo = photograph("front", (600, 600), seen, {"K": np.array(K)})
            setup = keypoint_fit(Observations(names, (photo,)), body, "?", kernel=kernel)
            start = setup.problem.linearize(setup.start).residual
            costs[kernel, confidence] = float(
                np.sum(start[setup.problem.rows["keypoints(front)"]] ** 2)
            )
        assert costs[kernel, 0.5] == pytest.approx(costs[kernel, 1.0] / 4, rel=1e-9)


def test_training_trusts_vertices_and_edges_as_they_were_seen() -> None:
    """The trust of a vertex is its weight: half the trust is half the cost."""
    seen, faces = np.array([1.0, 0.5, 0.25]), np.array([[0, 1, 2]])
    assert VertexTerm().confidence(seen).tolist() == [1.0, 0.5, 0.25]
    assert sorted(EdgeTerm(faces).confidence(seen).tolist()) == [0.25, 0.25, 0.5]
