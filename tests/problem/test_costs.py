"""Costs of many points at once are the costs of each."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.compilers import NEEDS_A_COMPILER
from tests.tiers import THOROUGH
from workbench.problem.costs import CostMethod, compiled, interpreted
from workbench.residuals import geman_mcclure, huber


def problems() -> dict[str, tuple[wb.Problem, wb.Values]]:
    body = wb.load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    start = body.start()
    joints = body.joint_points(pose, betas, trans)
    coco = body.landmark_points("coco", pose, betas, trans)
    some = body.points(pose, betas, trans)
    prior = wb.residuals.gaussian(betas, name="prior")
    camera = wb.Camera("camera/")
    seen = wb.Block("seen", (23, 2), "px")
    K = [[900.0, 0, 320], [0, 900, 240], [0, 0, 1]]
    photo = camera.values(K=K, R=np.diag([1.0, -1, -1]), t=[0, 0, 3], distortion=[0.1, -0.2])
    mixed = start | photo | {"seen": np.full((23, 2), 300.0)}
    return {
        "joints": (
            wb.Problem(
                [wb.residuals.landmarks(joints, body.joints() + 0.01, sigma=0.02), prior],
                ("pose", "betas", "trans"),
            ),
            start,
        ),
        "keypoints": (
            wb.Problem(
                [
                    wb.residuals.keypoints(
                        coco,
                        camera,
                        seen.symbol,
                        np.linspace(0, 1, 23),
                        sigma=4.0,
                        kernel=geman_mcclure,
                    ),
                    prior,
                ],
                ("pose", "betas", "trans", "camera/focal"),
                blocks=[seen, *camera.blocks],
            ),
            mixed,
        ),
        "vertices": (
            wb.Problem(
                [wb.residuals.vertices(some, body.vertices(), sigma=0.01, kernel=huber()), prior],
                ("pose", "betas", "trans"),
            ),
            start,
        ),
    }


@pytest.mark.parametrize(
    ("name", "only", "way"),
    [
        ("joints", None, interpreted),
        ("keypoints", "betas", interpreted),
        pytest.param("joints", None, compiled, marks=NEEDS_A_COMPILER),
        pytest.param("keypoints", None, compiled, marks=(NEEDS_A_COMPILER, THOROUGH)),
        pytest.param("vertices", "betas", compiled, marks=(NEEDS_A_COMPILER, THOROUGH)),
        pytest.param("vertices", None, interpreted, marks=THOROUGH),
    ],
)
def test_costs_of_many_points_match_each(name: str, only: str | None, way: CostMethod) -> None:
    problem, start = problems()[name]
    x, fixed = problem.split(start)
    at = problem.free.slices[only] if only else slice(None)
    places = np.arange(problem.free.size)[at]
    costs = problem.costs(x, fixed, places, way)
    rng = np.random.default_rng(0)
    for count in (1, 33, 70):
        X = np.repeat(x[None], count, axis=0)
        X[:, places] += 0.1 * rng.standard_normal((count, places.size))
        each = [0.5 * np.sum(problem.residual(row, fixed) ** 2) for row in X]
        np.testing.assert_allclose(costs(X[:, places]), each, rtol=1e-10)


@pytest.mark.parametrize(
    ("name", "only"),
    [("keypoints", "betas"), pytest.param("joints", None, marks=THOROUGH)],
)
def test_gradients_of_many_points_match_each(name: str, only: str | None) -> None:
    problem, start = problems()[name]
    x, fixed = problem.split(start)
    places = np.arange(problem.free.size)[problem.free.slices[only] if only else slice(None)]
    X = np.repeat(x[None], 5, axis=0)
    X[:, places] += 0.1 * np.random.default_rng(0).standard_normal((5, places.size))
    costs, gradients = problem.cost_gradients(x, fixed, places)(X[:, places])
    for row, cost, gradient in zip(X, costs, gradients, strict=True):
        right, slope = problem.cost_and_gradient(row, fixed)
        assert cost == pytest.approx(right, rel=1e-10)
        np.testing.assert_allclose(gradient, slope[places], rtol=1e-8, atol=1e-8 * abs(slope).max())


def test_costs_of_points_by_a_graph_alone() -> None:
    """Dual quaternions and free arrays know no arithmetic."""
    body = wb.load_body("small").freed("J_regressor")
    pose, betas, trans = (block.symbol for block in body.blocks())
    joints = body.joint_points(pose, betas, trans)
    problem = wb.Problem([wb.residuals.landmarks(joints, body.joints(), sigma=0.1)], "pose")
    x, fixed = problem.split(body.start())
    X = x + 0.1 * np.random.default_rng(0).standard_normal((5, x.size))
    each = [0.5 * np.sum(problem.residual(row, fixed) ** 2) for row in X]
    np.testing.assert_allclose(problem.costs(x, fixed)(X), each, rtol=1e-10)


def test_costs_of_points_that_read_no_block() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    scan, far = np.array([[0.2, 0.3, -0.1]]), wb.Block("far", (1,), "m")
    still = wb.residuals.scan_to_model(cs.MX(cs.DM(corners.T)), faces, scan, sigma=0.1)
    moving = wb.Residual("moving", far.symbol - 1.0, 0.5, "m", blocks=(far,))
    problem = wb.Problem([still, moving], "far")
    x, fixed = problem.split({"far": [3.0]})
    np.testing.assert_allclose(problem.costs(x, fixed)(np.array([[3.0], [2.0]])), [8.5, 2.5])
