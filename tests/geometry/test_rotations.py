"""Rotations against 50 digits of truth, dual quaternions against SciPy and 4 x 4 matrices."""

from functools import cache

import casadi as cs
import mpmath
import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from tests.tiers import few
from workbench.geometry.dual_quaternions import dual_quaternions, moved
from workbench.geometry.rotation import (
    SERIES_BELOW,
    inverse_left_jacobian,
    left_jacobian,
    matrix_from_vector,
    nearest_rotation,
    quaternions_of_vectors,
    rodrigues,
    vector_from_matrix,
)

Array = np.ndarray
SWITCH = float(np.sqrt(SERIES_BELOW))  # 0.5 rad: from the series to the closed form
ANGLES = (0, 1e-9, 1e-3, 1, np.pi, 6.2)
AROUND_THE_SWITCH = (SWITCH * (1 - 1e-15), SWITCH, SWITCH * (1 + 1e-15))
DIRECTIONS = np.array([[1, 0, 0], [0, -1, 0], [0.48, 0.6, -0.64], [-0.6, 0.0, 0.8]])
TOLERANCE = 1e-12  # entries of R and its derivatives are of order one; eps is 2e-16
KINDS = pytest.mark.parametrize(
    "kind", few([pytest.param(k, id=k.__name__) for k in (cs.SX, cs.MX)], 1)
)


def skew(w: Array) -> Array:
    """[w]x, the matrix of v -> w x v."""
    return np.cross(np.eye(3), w)


@cache
def truth(w: tuple[float, float, float]) -> tuple[Array, Array, Array]:
    """exp([w]x), its gradient [..., k] and its Hessian [..., k, l], summed as power series.

    The derivatives follow the powers: with A = [w]x and E_k = dA/dw_k,
    d_k A^(n+1) = d_k A^n A + A^n E_k, and likewise for the second ones.
    """
    with mpmath.workdps(50):
        zero = np.array([[mpmath.mpf(0)] * 3] * 3, dtype=object)
        E = [zero + skew(e).astype(int) for e in np.eye(3)]
        A = sum(E[k] * mpmath.mpf(w[k]) for k in range(3))
        P, D, H = zero + np.eye(3, dtype=int), [zero] * 3, [[zero] * 3] * 3
        R, dR, ddR = P, [zero] * 3, [[zero] * 3] * 3
        factorial = mpmath.mpf(1)
        for n in range(1, 60):  # 6.3^60 / 60! is below 1e-33
            H = [[H[k][m] @ A + D[k] @ E[m] + D[m] @ E[k] for m in range(3)] for k in range(3)]
            D = [D[k] @ A + P @ E[k] for k in range(3)]
            P = P @ A
            factorial *= n
            R = R + P / factorial
            dR = [dR[k] + D[k] / factorial for k in range(3)]
            ddR = [[ddR[k][m] + H[k][m] / factorial for m in range(3)] for k in range(3)]
        first = np.moveaxis(np.array(dR), 0, -1).astype(float)
        second = np.moveaxis(np.array(ddR), (0, 1), (-2, -1)).astype(float)
        return R.astype(float), first, second


@cache
def value_gradient_hessian(kind: type) -> cs.Function:
    w = kind.sym("w", 3)
    r = cs.vec(rodrigues(w))
    J = cs.jacobian(r, w)
    return cs.Function("f", [w], [r, J, cs.jacobian(cs.vec(J), w)])


@KINDS
@pytest.mark.parametrize("angle", few([*ANGLES, *AROUND_THE_SWITCH], (0, 1e-3, np.pi, SWITCH)))
def test_value_jacobian_and_hessian_are_exact(angle: float, kind: type) -> None:
    for direction in DIRECTIONS:
        w = angle * direction
        r, J, H = (np.asarray(out) for out in value_gradient_hessian(kind)(w))
        R, dR, ddR = truth(tuple(w))
        np.testing.assert_allclose(r.reshape(3, 3).T, R, rtol=0, atol=TOLERANCE)
        by_column = dR.transpose(1, 0, 2).reshape(9, 3)  # CasADi's vec runs down the columns
        np.testing.assert_allclose(J, by_column, rtol=0, atol=TOLERANCE)
        # the rows of H are vec(J): entry (i, k) of J at row i + 9 k
        second = ddR.transpose(2, 1, 0, 3).reshape(27, 3)
        np.testing.assert_allclose(H, second, rtol=0, atol=TOLERANCE)


def random_vectors(n: int = 200, longest: float = 6.2) -> Array:
    rng = np.random.default_rng(0)
    w = rng.normal(size=(n, 3))
    return w / np.linalg.norm(w, axis=1, keepdims=True) * rng.uniform(0, longest, (n, 1))


def test_logarithm_undoes_the_exponential() -> None:
    w = random_vectors(longest=3.1).reshape(2, 4, 25, 3)
    assert matrix_from_vector(w).shape == (2, 4, 25, 3, 3)
    np.testing.assert_allclose(vector_from_matrix(matrix_from_vector(w)), w, atol=1e-12)
    assert matrix_from_vector(np.zeros((0, 3))).shape == (0, 3, 3)
    expected = scipy.linalg.expm(skew(w[1, 2, 0]))
    np.testing.assert_allclose(matrix_from_vector(w)[1, 2, 0], expected, atol=1e-13)
    R = matrix_from_vector(random_vectors()).reshape(10, 20, 3, 3)  # also beyond half a turn
    np.testing.assert_allclose(matrix_from_vector(vector_from_matrix(R)), R, atol=1e-13)
    assert np.linalg.norm(vector_from_matrix(R), axis=-1).max() <= np.pi + 1e-12


def test_left_jacobian_turns_changes_of_vectors_into_turns() -> None:
    rng = np.random.default_rng(4)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    for angle in (0.0, 1e-9, 1e-3, 1.0, np.pi, 6.0):
        w, L, h = angle * axis, left_jacobian(angle * axis), 1e-5
        for d in np.eye(3):
            turned = matrix_from_vector(w + h * d) @ matrix_from_vector(w - h * d).T
            found = vector_from_matrix(turned) / (2 * h)
            np.testing.assert_allclose(L @ d, found, rtol=0, atol=1e-9)
        np.testing.assert_allclose(inverse_left_jacobian(w) @ L, np.eye(3), rtol=0, atol=1e-12)


def test_no_rotation_is_nearer_than_the_nearest() -> None:
    rotations = matrix_from_vector(random_vectors())
    np.testing.assert_allclose(nearest_rotation(rotations), rotations, atol=1e-14)
    rng = np.random.default_rng(1)
    others = Rotation.random(1000, rng=rng).as_matrix()
    matrices = rng.normal(size=(20, 3, 3))
    matrices[:10] *= np.sign(np.linalg.det(matrices[:10]))[:, None, None]
    matrices[10:] *= -np.sign(np.linalg.det(matrices[10:]))[:, None, None]  # reflections
    for M, R in zip(matrices, nearest_rotation(matrices), strict=True):
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) > 0
        # all of them, and a crowd around R itself
        close = R @ matrix_from_vector(1e-3 * rng.normal(size=(100, 3)))
        distances = np.linalg.norm(np.concatenate([others, close]) - M, axis=(1, 2))
        assert np.linalg.norm(R - M) <= distances.min() + 1e-14


# Quaternions.

AXES = np.vstack([np.eye(3), -np.eye(3), np.random.default_rng(0).normal(size=(20, 3))])
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)
EACH_ANGLE = pytest.mark.parametrize(
    "angle", few([0.0, 2.0, np.pi, 1e-6, np.pi - 1e-9, 6.0, np.pi / 2, 2 * np.pi / 3], 3)
)


def motions(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    R = Rotation.random(n, random_state=rng).as_matrix()
    return np.concatenate([R, rng.normal(size=(n, 3, 1))], axis=2)


def as_columns(found: cs.DM) -> np.ndarray:
    return np.asarray(found).T


@EACH_ANGLE
def test_quaternions_are_those_of_the_rotations(angle: float) -> None:
    """Also half turns, which are opposite after a full turn."""
    R = Rotation.from_rotvec(angle * AXES)
    still = [cs.DM(np.column_stack([matrix, np.zeros(3)])) for matrix in R.as_matrix()]
    found = as_columns(dual_quaternions(still)[:4, :])
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-14)
    back = Rotation.from_quat(found[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(back, R.as_matrix(), atol=2e-15)
    found = as_columns(quaternions_of_vectors(cs.DM((angle * AXES).T)))
    expected = np.column_stack([np.full(len(AXES), np.cos(angle / 2)), np.sin(angle / 2) * AXES])
    np.testing.assert_allclose(found, expected, atol=1e-15)
    further = as_columns(quaternions_of_vectors(cs.DM(((angle + 2 * np.pi) * AXES).T)))
    np.testing.assert_allclose(further, -expected, atol=2e-15)


def test_dual_quaternions_move_points_as_matrices_do() -> None:
    M, v = motions(40), np.random.default_rng(1).normal(size=(40, 3))
    dual = dual_quaternions([cs.DM(m) for m in M])
    expected = np.einsum("nij,nj->ni", M[:, :, :3], v) + M[:, :, 3]
    np.testing.assert_allclose(as_columns(moved(cs.DM(v.T), dual)), expected, atol=1e-14)
    for factor in (-1.0, 7.0, -0.01):
        found = as_columns(moved(cs.DM(v.T), factor * dual))
        np.testing.assert_allclose(found, expected, atol=1e-13)
    askew = dual + cs.vertcat(cs.DM.zeros(4, 40), 0.3 * dual[:4, :])  # no longer orthogonal
    np.testing.assert_allclose(as_columns(moved(cs.DM(v.T), askew)), expected, atol=1e-13)
