"""What is promised of every residual: exact derivatives, and zero where nothing is wrong."""

import ast
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.differences import assert_hessian, assert_jacobian
from tests.tiers import THOROUGH
from workbench import Block, Camera, Problem, Residual, Values, residuals
from workbench.residuals import Kernel, geman_mcclure, huber, of_norms, quadratic

BODY = random_body(n_vertices=6, n_joints=3, n_betas=2)
POSE, BETAS, TRANS = BODY.blocks()
SYMBOLS = (POSE.symbol, BETAS.symbol, TRANS.symbol)
ARGUMENTS: Values = {
    "pose": np.random.default_rng(0).normal(scale=0.4, size=(3, 3)),
    "betas": np.array([0.7, -1.1]),
    "trans": np.array([0.1, 0.2, 4.0]),
}
KERNELS = [
    pytest.param(geman_mcclure, id="geman-mcclure"),
    pytest.param(quadratic, id="quadratic", marks=THOROUGH),
    pytest.param(huber(0.7), id="huber", marks=THOROUGH),
]


@dataclass(frozen=True, eq=False)
class Case:
    """A residual with values at which it is zero, and how far from there it is looked at."""

    residual: Residual
    null: Values
    spread: float = 0.2

    def problem(self, kernel: Kernel) -> Problem:
        """Everything that the residual reads is free."""
        return Problem((replace(self.residual, kernel=kernel),), self.residual.reads)


def vertices() -> Case:
    observed = Block("observed", (6, 3), "m").symbol
    residual = residuals.vertices(BODY.points(*SYMBOLS), observed, sigma=0.2)
    return Case(residual, ARGUMENTS | {"observed": BODY.vertices(*ARGUMENTS.values())})


def edges() -> Case:
    observed, trust = Block("observed", (6, 3), "m").symbol, Block("trust", (3,)).symbol
    residual = residuals.edges(
        BODY.points(*SYMBOLS), observed, [[0, 1], [4, 2], [3, 5]], sigma=0.2, confidence=trust
    )
    seen = {"observed": BODY.vertices(*ARGUMENTS.values()) + 7.0, "trust": np.array([1, 0.5, 0.2])}
    return Case(residual, ARGUMENTS | seen)


def landmarks() -> Case:
    observed = Block("observed", (3, 3), "m").symbol
    residual = residuals.landmarks(BODY.joint_points(*SYMBOLS), observed, sigma=0.2)
    return Case(residual, ARGUMENTS | {"observed": BODY.joints(*ARGUMENTS.values())})


def keypoints() -> Case:
    camera = Camera("cam/")
    observed, confidence = Block("observed", (3, 2), "px"), Block("confidence", (3,))
    residual = residuals.keypoints(
        BODY.joint_points(*SYMBOLS), camera, observed.symbol, confidence.symbol, sigma=8.0
    )
    lens = camera.values(
        K=[[900, 0, 640], [0, 950, 360], [0, 0, 1]],
        R=np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]),
        t=(0.3, 0.0, 1.0),
        distortion=(-0.2, 0.05, 0.003, -0.002, 0.01),
    )
    pixels = camera.pixels(BODY.joints(*ARGUMENTS.values()), lens)
    seen = {"observed": pixels, "confidence": np.array([1.0, 0.5, 0.2])}
    return Case(residual, ARGUMENTS | lens | seen, spread=0.02)


def gaussian_scalar() -> Case:
    residual = residuals.gaussian(POSE.symbol, mean=0.3, covariance=0.04, unit="rad")
    return Case(residual, {"pose": np.full((3, 3), 0.3)})


def gaussian_vector() -> Case:
    mean, variances = np.array([0.3, -0.2]), np.array([0.04, 0.25])
    return Case(
        residuals.gaussian(BETAS.symbol, mean=mean, covariance=variances), {"betas": mean}, 0.5
    )


def gaussian_matrix() -> Case:
    rng = np.random.default_rng(1)
    A, mean = 0.3 * rng.normal(size=(9, 9)), rng.normal(size=9)
    residual = residuals.gaussian(POSE.symbol, mean=mean, covariance=A @ A.T + 0.01 * np.eye(9))
    return Case(residual, {"pose": mean.reshape(3, 3)})


def stitching() -> Case:
    faces, placed = np.array([[0, 1, 2], [3, 2, 4]]), Block("placed", (5, 3), "m")
    V = np.random.default_rng(2).normal(size=(5, 3))
    edges = Block("edges", (4, 3), "m").symbol
    residual = residuals.stitching(placed.symbol, edges, faces, sigma=0.2)
    return Case(residual, {"placed": V, "edges": V[[2, 1, 4, 2]] - V[[0, 0, 3, 3]]})


def mirrored() -> Case:
    side, middle = np.random.default_rng(3).normal(size=(2, 2, 3))
    middle[:, 0] = 0.0
    placed = Block("placed", (6, 3), "m")
    residual = residuals.mirrored(placed.symbol, [1, 0, 2, 4, 3, 5], sigma=0.2)
    pairs = [side[0], side[0] * [-1, 1, 1], middle[0], side[1], side[1] * [-1, 1, 1], middle[1]]
    return Case(residual, {"placed": np.stack(pairs)})


def regressed() -> Case:
    rng = np.random.default_rng(4)
    V, R = rng.normal(size=(5, 3)), rng.random((2, 5))
    joints, surface = Block("joints", (2, 3), "m"), Block("surface", (5, 3), "m")
    regressor = Block("regressor", (2, 5))
    residual = residuals.regressed(joints.symbol, surface.symbol, regressor.symbol, sigma=0.2)
    return Case(residual, {"joints": R @ V, "surface": V, "regressor": R})


def limits() -> Case:
    residual = residuals.limits(POSE, -0.5, 0.7, sigma=0.2)
    return Case(residual, {"pose": np.zeros((3, 3))}, spread=0.8)


def max_mixture() -> Case:
    rng = np.random.default_rng(5)
    means, factors = rng.normal(size=(3, 2)), rng.normal(size=(3, 2, 2)) + 2 * np.eye(2)
    C = factors @ factors.swapaxes(1, 2)
    shares = np.array([0.2, 0.5, 0.3])
    best = int(np.argmax(shares / np.sqrt(np.linalg.det(C))))
    residual = residuals.max_mixture(BETAS.symbol, shares=shares, means=means, covariances=C)
    return Case(residual, {"betas": means[best]}, spread=2.0)


CASES: list[Callable[[], Case]] = [
    vertices,
    edges,
    stitching,
    landmarks,
    keypoints,
    gaussian_scalar,
    gaussian_vector,
    gaussian_matrix,
    limits,
    max_mixture,
    mirrored,
    regressed,
]
POINTS = [build for build in CASES if build().residual.rows_per_point > 1]
EACH_CASE = pytest.mark.parametrize("build", CASES, ids=lambda build: build.__name__)
EACH_OF_POINTS = pytest.mark.parametrize("build", POINTS, ids=lambda build: build.__name__)
EACH_KERNEL = pytest.mark.parametrize("kernel", KERNELS)


def near(case: Case, problem: Problem, seed: int) -> np.ndarray:
    x = problem.free.pack(case.null)
    return x + case.spread * np.random.default_rng(seed).normal(size=x.size) * np.maximum(
        1, 0.02 * abs(x)
    )


@EACH_CASE
@EACH_KERNEL
def test_derivatives_match_differences(build: Callable[[], Case], kernel: Kernel) -> None:
    case = build()
    problem = case.problem(kernel)
    for x in (problem.free.pack(case.null), near(case, problem, 0)):
        assert_jacobian(problem, x, np.zeros(0), 1e-8)
        assert_hessian(problem, x, np.zeros(0), 1e-8)


@EACH_OF_POINTS
@EACH_KERNEL
def test_derivatives_of_norm_kernels_match_differences(
    build: Callable[[], Case], kernel: Kernel
) -> None:
    """Also at the null point, where a row |p - q| would have none."""
    case = build()
    problem = case.problem(of_norms(kernel))
    for x in (problem.free.pack(case.null), near(case, problem, 0)):
        assert_jacobian(problem, x, np.zeros(0), 1e-8)
        assert_hessian(problem, x, np.zeros(0), 1e-8)
    assert problem.rows.keys() == case.problem(kernel).rows.keys()
    np.testing.assert_allclose(problem.linearize(case.null).residual, 0, atol=1e-13)  # as below


@EACH_CASE
def test_residual_vanishes_at_truth_and_sigma_whitens(build: Callable[[], Case]) -> None:
    case = build()
    problem = case.problem(quadratic)
    r = problem.linearize(case.null).residual
    assert r.shape == (case.residual.size,)
    # points are made of numbers of order 4 m, pixels of 1e3 px: some eps of these, in sigmas
    np.testing.assert_allclose(r, 0, atol=1e-13)
    x = near(case, problem, 0)
    wider = replace(case.residual, sigma=2 * np.asarray(case.residual.sigma))
    half = Problem((wider,), wider.reads).residual(x, np.zeros(0))
    np.testing.assert_allclose(half, problem.residual(x, np.zeros(0)) / 2, rtol=1e-12)
    residual = case.residual
    labels = [residual.label(row) for row in range(residual.size)]
    assert len(set(labels)) == residual.size
    assert all(label.startswith(residual.name + "[") for label in labels)


ELSEWHERE = {
    "gaussian",  # three cases of it
    "smooth",  # between the frames of a sequence: tests/problem/test_sequence_terms.py
    "scan_to_model",  # contacts that change, without a graph: tests/residuals/test_scans.py
    "free_space",  # the same: tests/residuals/test_scans.py
    "bending",  # never zero: tests/residuals/test_image_terms.py
    "apart",  # of capsules: tests/residuals/test_self_contact.py
    "spheres",
}


def test_every_residual_is_exported_and_has_a_case() -> None:
    names = {build.__name__ for build in CASES}
    tried = names | ELSEWHERE
    for path in sorted(Path(residuals.__file__).parent.glob("*.py")):
        for node in ast.parse(path.read_text()).body:
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                continue
            if node.returns is None or ast.unparse(node.returns) not in ("Residual", "Between"):
                continue
            assert node.name in residuals.__all__, (
                f"import {node.name} of {path.name} in workbench/residuals/__init__.py, and put "
                "its name into __all__ there"
            )
            assert node.name in tried, f"write a case called {node.name}, and put it into CASES"
