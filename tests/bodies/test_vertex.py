"""One vertex in symbols says what the whole graph says."""

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench.bodies.vertex import motion_column, vertex_columns, vertex_functions
from workbench.bodies.vertex_code import kernel
from workbench.errors import NotSupported


@pytest.mark.parametrize("bound", [False, True])
@pytest.mark.parametrize(("K", "B"), [(6, 3), (4, 0), (1, 2), (1, 0)])
def test_the_functions_of_one_vertex(K: int, B: int, bound: bool) -> None:
    body = random_body(K, n_vertices=4, n_joints=K, n_betas=B, bound=bound)
    rng = np.random.default_rng(0)
    pose, betas = rng.standard_normal((K, 3)), rng.standard_normal(B)
    symbols = [block.symbol for block in body.blocks()]
    whole = cs.vec(body.points(*symbols).source.expression)
    J = cs.Function("J", symbols, [whole, *(cs.jacobian(whole, s) for s in symbols[:2])])
    points, by_pose, by_betas = (np.asarray(a) for a in J(pose.T, betas, np.zeros(3)))

    f = vertex_functions(body.parents, B)
    motion = motion_column(
        body.kinematics.motion(pose, betas), betas, body.kinematics.slopes(pose, betas)
    )
    columns = vertex_columns(body, np.arange(4))
    P = columns[3 + K + 3 * B :].reshape(K - 1, 27, 4)
    S = columns[3 + K : 3 + K + 3 * B].reshape(B, 3, 4)
    of_betas = motion[len(motion) - 3 * K * B :].reshape(B, 3 * K)
    of_joints = motion[: len(motion) - 3 * K * B][-36 * K :].reshape(K, 36)
    for i in range(4):
        vertex, rows = columns[:, i], slice(3 * i, 3 * i + 3)
        np.testing.assert_allclose(np.asarray(f.point(vertex, motion)), points[rows], atol=1e-13)
        R, arms = f.rotation(vertex, motion), np.asarray(f.arms(vertex, motion)).reshape(K, 3)
        for k in range(K):
            bends = P[k - 1, :, i] if k else np.zeros(27)
            found = np.asarray(f.by_joint(bends, R, arms[k], of_joints[k])).reshape(3, 3).T
            expected = by_pose[rows, 3 * k : 3 * k + 3]
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
        for b in range(B):
            found = np.asarray(f.by_beta(S[b, :, i], R, vertex[3 : 3 + K], of_betas[b]))
            np.testing.assert_allclose(found, by_betas[rows, b : b + 1], rtol=0, atol=1e-12)


def test_pulled_is_the_gradient_of_the_point() -> None:
    f = vertex_functions((-1, 0, 1), 2)
    rng = np.random.default_rng(1)
    vertex, motion = (rng.standard_normal(f.point.nnz_in(i)) for i in range(2))
    pull, step = rng.standard_normal(3), rng.standard_normal(f.pulled.nnz_out(0))
    moved = motion.copy()
    moved[: len(step)] += 1e-6 * step
    back = motion.copy()
    back[: len(step)] -= 1e-6 * step
    slope = (np.asarray(f.point(vertex, moved)) - np.asarray(f.point(vertex, back))) / 2e-6
    felt = np.asarray(f.pulled(vertex, motion, pull)).ravel()
    np.testing.assert_allclose(felt @ step, pull @ slope.ravel(), rtol=1e-8)


def test_operations_that_have_no_code_are_refused_by_name() -> None:
    x = cs.SX.sym("x")
    with pytest.raises(NotSupported, match="'sine' has no C here"):
        kernel(cs.Function("sine", [x], [cs.sin(x)]))


def test_constants_and_signs_have_code() -> None:
    x = cs.SX.sym("x", 2)
    text = kernel(cs.Function("f", [x], [cs.vertcat(-x[0], x[1] * 0.1)], ["motion"], ["out"]))
    assert "BROADCAST(0.1)" in text
    assert "= -w" in text
    assert "BROADCAST(i0[1])" in text
