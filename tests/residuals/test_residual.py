"""Names, labels, priors, and residuals that cannot be."""

from typing import Any

import casadi as cs
import numpy as np
import pytest
import scipy.stats

from tests.bodies_made_up import random_body, smpl_like_body
from workbench import Block, Camera, Problem, Residual, residuals
from workbench.errors import BadResidual, NonFiniteValue, NotNumbers
from workbench.residuals import gaussian, keypoints, landmarks

X = Block("x", (3,))


def test_residual_is_named_after_function_and_blocks() -> None:
    body = smpl_like_body()
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("scan/joints", (24, 3)).symbol
    residual = landmarks(body.joint_points(*symbols), observed, sigma=0.01)
    assert residual.name == "landmarks(scan/joints)"
    assert residual.label(3 * 20 + 1) == "landmarks(scan/joints)[left_wrist, y]"
    assert residual.unit == "m"
    assert gaussian(symbols[1]).name == "gaussian(betas)"
    assert gaussian(symbols[0][:, 1:]).name == "gaussian(pose)"
    assert gaussian(symbols[1], name="prior").name == "prior"
    pixels, confidence = Block("seen", (24, 2)).symbol, Block("c", (24,)).symbol
    seen = keypoints(body.joint_points(*symbols), Camera(), pixels, confidence, sigma=5.0)
    assert seen.label(2 * 21) == "keypoints(seen)[right_wrist, u]"
    assert gaussian(symbols[1]).label(2) == "gaussian(betas)[2]"


def test_bare_matrices_are_points() -> None:
    points, observed = Block("p", (4, 3)), Block("o", (4, 3))
    problem = Problem((residuals.vertices(points.symbol, observed.symbol, sigma=0.5),), ("p",))
    p, o = np.random.default_rng(0).normal(size=(2, 4, 3))
    r = problem.linearize({"p": p, "o": o}).residual
    np.testing.assert_allclose(r, (p - o).ravel() / 0.5, rtol=1e-14)


def test_keypoint_of_confidence_zero_is_ignored() -> None:
    points, observed, confidence = Block("p", (3, 3)), Block("o", (3, 2)), Block("c", (3,))
    camera = Camera()
    residual = keypoints(points.symbol, camera, observed.symbol, confidence.symbol, sigma=2.0)
    problem = Problem((residual,), ("p",))
    values = camera.values(K=[[500, 0, 320], [0, 500, 240], [0, 0, 1]], t=(0, 0, 3.0))
    values |= {"p": np.random.default_rng(0).normal(size=(3, 3)), "c": np.array([1.0, 0.0, 0.5])}
    here = problem.linearize(values | {"o": np.full((3, 2), 1e6)})
    assert not here.residual[2:4].any()
    assert not here.jacobian[2:4].any()
    expected = (camera.pixels(values["p"], values) - 1e6) * np.sqrt(values["c"])[:, None] / 2.0
    np.testing.assert_allclose(here.residual, expected.ravel(), rtol=1e-14)
    with pytest.raises(NonFiniteValue, match=r"'o' holds nan at \[1, 0\].*confidence 0"):
        problem.linearize(values | {"o": np.array([[1, 1], [np.nan, 2], [3, np.nan]])})


# Gaussians.


def test_gaussian_cost_is_minus_log_density() -> None:
    for covariance in [
        0.3,
        np.array([0.1, 2.0, 0.5]),
        np.array([[2, 0.5, 0], [0.5, 1, -0.3], [0, -0.3, 0.4]]),
    ]:
        mean = np.array([0.5, -1.0, 2.0])
        problem = Problem((gaussian(X.symbol, mean=mean, covariance=covariance),), ("x",))
        C = np.asarray(covariance)
        density = scipy.stats.multivariate_normal(mean, C if C.ndim == 2 else C * np.eye(3))
        for x in np.random.default_rng(0).normal(size=(5, 3)):
            cost = problem.linearize({"x": x}).cost
            constant = density.logpdf(mean)
            assert cost == pytest.approx(constant - density.logpdf(x), rel=1e-12)
            full = np.linalg.inv(C if C.ndim == 2 else C * np.eye(3))
            assert 2 * cost == pytest.approx((x - mean) @ full @ (x - mean), rel=1e-12)


def test_mean_is_read_in_the_order_of_arrays() -> None:
    pose = Block("pose", (4, 3))
    mean = np.random.default_rng(0).normal(size=(4, 3))
    for given in (mean, mean.ravel()):
        problem = Problem((gaussian(pose.symbol, mean=given),), ("pose",))
        assert not problem.linearize({"pose": mean}).residual.any()


def test_bad_gaussians_are_refused() -> None:
    for arguments, text in [
        ({"mean": np.zeros(2)}, r"mean of \(2,\)"),
        ({"covariance": np.ones(2)}, r"covariance of \(2,\)"),
        ({"covariance": 0.0}, "variances above zero, not 0.0"),
        ({"covariance": np.diag([1.0, -2.0, 1.0])}, "smallest eigenvalue"),
        ({"covariance": np.triu(np.ones((3, 3)))}, "finite and symmetric"),
        ({"mean": np.array([0.0, np.nan, 1.0])}, "finite mean"),
    ]:
        with pytest.raises((BadResidual, NotNumbers), match=rf"'gaussian\(x\)'.*{text}"):
            gaussian(X.symbol, **arguments)


# Residuals that cannot be.


def test_bad_sigmas_are_refused() -> None:
    for sigma in [-1.0, np.inf, np.ones(2), np.array([1.0, 0.0, 1.0])]:
        with pytest.raises(BadResidual, match="above zero, in m"):
            Residual("x", X.symbol, sigma, "m")


def test_residual_must_be_a_column() -> None:
    with pytest.raises(BadResidual, match=r"must be a column \(m, 1\), not \(3, 4\); casadi.vec"):
        Residual("x", cs.MX.sym("x", 3, 4), 1.0)
    with pytest.raises(BadResidual, match="has 3 rows but 1 labels"):
        Residual("x", X.symbol, 1.0, labels=("a",))


def test_points_and_observations_must_match() -> None:
    body = random_body()
    symbols = [block.symbol for block in body.blocks()]
    points = body.joint_points(*symbols)
    text = r"compares 5 points \(5, {}\) with a block of shape \({}\); they must be the same"
    with pytest.raises(BadResidual, match=text.format(3, "6, 3")):
        landmarks(points, Block("o", (6, 3)).symbol, sigma=1.0)
    with pytest.raises(BadResidual, match=text.format(2, "5, 3")):
        keypoints(points, Camera(), Block("o", (5, 3)).symbol, Block("c", (5,)).symbol, sigma=1.0)
    with pytest.raises(BadResidual, match=r"has 5 keypoints, but confidences of shape \(4, 1\)"):
        keypoints(points, Camera(), Block("o", (5, 2)).symbol, Block("c", (4,)).symbol, sigma=1.0)


# Numbers instead of symbols.


def test_observations_may_be_arrays() -> None:
    body, rng = random_body(), np.random.default_rng(0)
    symbols = [block.symbol for block in body.blocks()]
    points, joints, camera = body.points(*symbols), body.joint_points(*symbols), Camera("c/")
    v, j, u, c = (rng.normal(size=shape) for shape in ((30, 3), (5, 3), (5, 2), (5,)))
    observed = {"v": v, "j": j, "u": u, "c": abs(c)}
    blocks = {name: Block(name, array.shape).symbol for name, array in observed.items()}

    def problem(given: dict[str, Any]) -> Problem:
        terms = (
            residuals.vertices(points, given["v"], sigma=0.1, name="v"),
            landmarks(joints, given["j"], sigma=0.1, name="j"),
            keypoints(joints, camera, given["u"], given["c"], sigma=5.0, name="u"),
        )
        return Problem(terms, ("pose", "betas", "trans"))

    values = body.start() | camera.values(K=[[500, 0, 320], [0, 500, 240], [0, 0, 1]], t=(0, 0, 3))
    expected = problem(blocks).linearize(values | observed)
    as_matrices = {name: cs.DM(array.T) for name, array in observed.items()}  # (3, N), as in CasADi
    as_lists = {name: array.tolist() for name, array in observed.items()}
    for given in (observed, as_matrices, as_lists):
        here = problem(given).linearize(values)
        np.testing.assert_array_equal(here.residual, expected.residual)
        np.testing.assert_array_equal(here.jacobian, expected.jacobian)
    assert set(problem(observed).fixed.names) == {block.name for block in camera.blocks}


def holed(shape: tuple[int, ...]) -> np.ndarray:
    array = np.zeros(shape)
    array[2:4] = np.nan
    return array


def test_observations_that_do_not_fit_are_refused() -> None:
    for observed, confidence, text in [
        (
            np.zeros((2, 5)),
            np.ones(5),
            r"observed as .* an array of shape \(5, 2\), not of \(2, 5\)",
        ),
        (np.zeros((5, 2)), np.ones(4), r"the confidence as .* of shape \(5,\), not of \(4,\)"),
        (holed((5, 2)), np.ones(5), r"row 2 of what was observed is \[nan nan\], and 2 of 5 rows"),
        (np.zeros((5, 2)), holed((5,)), r"row 2 of the confidence is nan, and 2 of 5 rows"),
        (Block("o", (5, 2)), np.ones(5), "what was observed must be a CasADi .*; take its .symbol"),
    ]:
        points = Block("p", (5, 3)).symbol
        with pytest.raises(
            (BadResidual, NotNumbers), match=rf"residual 'keypoints\((p|o)?\)'.*{text}"
        ):
            keypoints(points, Camera(), observed, confidence, sigma=1.0)


# Kernels that are none.


def test_huber_needs_a_positive_threshold() -> None:
    for threshold in [0, np.inf, "far"]:
        with pytest.raises(BadResidual, match="huber takes a threshold above zero"):
            residuals.huber(threshold)


def test_kernel_must_be_a_function() -> None:
    with pytest.raises(BadResidual, match=r"'x' needs a function as its kernel.*, not 1.345"):
        Residual("x", X.symbol, 1.0, kernel=1.345)  # type: ignore[arg-type]
    forgotten = Residual("x", X.symbol, 1.0, kernel=residuals.huber)  # type: ignore[arg-type]
    with pytest.raises(BadResidual, match=r"the kernel is huber\(\) or huber\(threshold\)"):
        _ = forgotten.whitened
