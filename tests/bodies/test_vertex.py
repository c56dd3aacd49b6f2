"""One vertex in symbols says what the whole graph says."""

from types import SimpleNamespace

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench.bodies.forward.kernel_code import kernel
from workbench.bodies.forward.vertex import (
    OF_JOINT,
    SLOPED,
    motion_column,
    shape_columns,
    slopes_column,
    vertex_columns,
    vertex_functions,
)
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

    f = SimpleNamespace(**vertex_functions(B))
    motion = motion_column(body.kinematics.motion(pose, betas))
    features, G, joints, _ = np.split(motion, np.cumsum([9 * (K - 1), 12 * K, 3 * K]))
    found = slopes_column(body.kinematics.slopes(pose, betas))
    of_joints, of_betas = np.split(found, [OF_JOINT * K])
    for i in range(4):
        rows = slice(3 * i, 3 * i + 3)
        template, w = np.split(vertex_columns(body, np.arange(4))[:, i], [3])
        S = shape_columns(body, np.arange(4))[:, i]
        P = body.posedirs[i].T.ravel()
        rest = number(f.shaped, template, S, betas)
        M = np.zeros(12)
        for k in range(K):
            M += number(f.blended, w[k], part(G, K, k))
            if k:
                rest += bent(f.bent, part(P, K - 1, k - 1), part(features, K - 1, k - 1))
        point = number(f.moved, M, rest)
        np.testing.assert_allclose(point, points[rows].ravel(), rtol=0, atol=1e-13)
        hanging = [number(f.below, w[k], part(G, K, k), rest) for k in range(K)]
        for k in range(K - 1, 0, -1):
            hanging[body.parents[k]] += number(f.hung, hanging[k])
        for k in range(K):
            arm = number(f.arm, hanging[k], part(joints, K, k))
            axes, slopes, _ = np.split(part(of_joints, K, k), [9, SLOPED])
            found = number(f.turned, arm, axes)
            if k:
                P_k = part(P, K - 1, k - 1)
                bulging = sum(
                    number(f.bulging, part(P_k, 9, n), part(slopes, 9, n)) for n in range(9)
                )
                found += number(f.bulged, M, bulging)
            expected = by_pose[rows, 3 * k : 3 * k + 3]
            np.testing.assert_allclose(found.reshape(3, 3).T, expected, rtol=0, atol=1e-12)
        for b in range(B):
            found = number(f.by_beta, part(S, B, b), M)
            for k in range(K):
                found += number(f.shifted, w[k], part(of_betas, B * K, b * K + k))
            np.testing.assert_allclose(found, by_betas[rows, b], rtol=0, atol=1e-12)


def number(f: cs.Function, *columns: object) -> np.ndarray:
    return np.asarray(f(*columns)).ravel()


def bent(of_one: cs.Function, P: np.ndarray, features: np.ndarray) -> np.ndarray:
    """The sum over the nine features of a joint, of which the function takes one."""
    return sum(number(of_one, part(P, 9, n), features[n]) for n in range(9))


def part(column: np.ndarray, count: int, i: int) -> np.ndarray:
    """The i-th of `count` parts of the same size."""
    return column.reshape(count, -1)[i]


def test_gradients_are_those_of_the_sums_they_belong_to() -> None:
    f = SimpleNamespace(**vertex_functions(2))
    rng = np.random.default_rng(1)
    v, pull, w = rng.standard_normal(3), rng.standard_normal(3), 0.3
    M, S, P = (rng.standard_normal(size) for size in (12, 6, 27))
    nowhere = np.zeros(3)
    for gradient, forward, size in (
        (number(f.on_rest, M, pull), lambda u: number(f.moved, M, u), 3),
        (number(f.on_betas, S, pull), lambda u: number(f.shaped, nowhere, S, u), 2),
        (number(f.on_features, P, pull), lambda u: bent(f.bent, P, u), 9),
        (number(f.on_motion, w, v, pull), lambda u: number(f.below, w, u, v)[:3], 12),
    ):
        u, step = rng.standard_normal(size), rng.standard_normal(size)
        slope = forward(u + step) - forward(u)  # affine, so exact
        np.testing.assert_allclose(gradient @ step, pull @ slope, rtol=1e-12)


def test_operations_that_have_no_code_are_refused_by_name() -> None:
    x = cs.SX.sym("x")
    with pytest.raises(NotSupported, match="'sine' has no C here"):
        kernel(cs.Function("sine", [x], [cs.sin(x)]))


def test_constants_and_signs_have_code() -> None:
    x = cs.SX.sym("x", 2)
    text = kernel(cs.Function("f", [x], [cs.vertcat(-x[0], x[1] * 0.1)], ["motion"], ["out"]))
    assert "BROADCAST(0.1)" in text
    assert "= -BROADCAST(i0[0])" in text
    assert "BROADCAST(i0[1])" in text
