"""Dual quaternions and screws against SciPy's rotations and 4 x 4 matrices."""

import casadi as cs
import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from tests.geometry.screws import between, dual_product, product, screw
from workbench.geometry.dual_quaternions import dual_quaternions, moved, quaternions
from workbench.geometry.rotation import half_turns, rodrigues

AXES = np.vstack([np.eye(3), -np.eye(3), np.random.default_rng(0).normal(size=(20, 3))])
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)
ANGLES = (0.0, 1e-12, 1e-6, 0.3, np.pi / 2, 2.0, 2 * np.pi / 3, np.pi - 1e-9, np.pi, 4.0, 6.0)


def motions(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    R = Rotation.random(n, random_state=rng).as_matrix()
    return np.concatenate([R, rng.normal(size=(n, 3, 1))], axis=2)


def as_columns(found: cs.DM) -> np.ndarray:
    return np.asarray(found).T


@pytest.mark.parametrize("angle", ANGLES)
def test_quaternions_are_those_of_the_rotations(angle: float) -> None:
    R = Rotation.from_rotvec(angle * AXES)
    found = as_columns(quaternions(cs.DM(np.concatenate(list(R.as_matrix()), axis=1))))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-14)
    back = Rotation.from_quat(found[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(back, R.as_matrix(), atol=2e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_half_turns_are_quaternions_and_opposite_after_a_full_turn(angle: float) -> None:
    found = as_columns(half_turns(cs.DM((angle * AXES).T)))
    expected = np.column_stack([np.full(len(AXES), np.cos(angle / 2)), np.sin(angle / 2) * AXES])
    np.testing.assert_allclose(found, expected, atol=1e-15)
    further = as_columns(half_turns(cs.DM(((angle + 2 * np.pi) * AXES).T)))
    np.testing.assert_allclose(further, -expected, atol=2e-15)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_derivative_of_a_quaternion_is_that_of_the_half_turn(angle: float) -> None:
    """Through R and Shepperd's columns, or straight from the vector: one curve, either sign."""
    w = cs.SX.sym("w", 3)
    through_R, straight = quaternions(rodrigues(w)), half_turns(w)
    outputs = []
    for q in (through_R, straight):
        J = cs.jacobian(q, w)
        outputs += [q, J, cs.jacobian(cs.vec(J), w)]
    f = cs.Function("f", [w], outputs)
    for axis in AXES:
        q, J, H, q2, J2, H2 = (np.asarray(part) for part in f(angle * axis))
        sign = np.sign((q.T @ q2).item())
        np.testing.assert_allclose(q, sign * q2, atol=2e-15)
        np.testing.assert_allclose(J, sign * J2, atol=1e-14)
        np.testing.assert_allclose(H, sign * H2, atol=5e-14)


def test_dual_quaternions_move_points_as_the_motions_do() -> None:
    M, v = motions(40), np.random.default_rng(1).normal(size=(40, 3))
    dual = dual_quaternions([cs.DM(m) for m in M])
    expected = np.einsum("nij,nj->ni", M[:, :, :3], v) + M[:, :, 3]
    np.testing.assert_allclose(as_columns(moved(cs.DM(v.T), dual)), expected, atol=1e-14)
    for factor in (-1.0, 7.0, -0.01):
        found = as_columns(moved(cs.DM(v.T), factor * dual))
        np.testing.assert_allclose(found, expected, atol=1e-13)
    askew = dual + cs.vertcat(cs.DM.zeros(4, 40), 0.3 * dual[:4, :])  # no longer orthogonal
    np.testing.assert_allclose(as_columns(moved(cs.DM(v.T), askew)), expected, atol=1e-13)


def test_products_are_motions_one_after_the_other() -> None:
    A, B = motions(30, 2), motions(30, 3)
    v = np.random.default_rng(4).normal(size=(30, 3))
    a, b = (dual_quaternions([cs.DM(m) for m in M]) for M in (A, B))
    one_by_one = moved(moved(cs.DM(v.T), b), a)
    np.testing.assert_allclose(moved(cs.DM(v.T), dual_product(a, b)), one_by_one, atol=1e-13)
    real = as_columns(product(a[:4, :], b[:4, :]))
    R = Rotation.from_matrix(A[:, :, :3] @ B[:, :, :3]).as_quat()[:, [3, 0, 1, 2]]
    assert np.abs(np.abs(np.sum(real * R, axis=1)) - 1).max() < 1e-14


# Screws.


def square(M: np.ndarray) -> np.ndarray:
    return np.vstack([M, [0, 0, 0, 1]])


@pytest.mark.parametrize("seed", range(5))
def test_a_share_of_a_motion_is_a_power_of_its_matrix(seed: int) -> None:
    M = motions(1, seed)[0]
    for share in (0.0, 0.25, 0.5, 1.0):
        power = expm(share * logm(square(M))).real
        np.testing.assert_allclose(screw(M, share), power[:3], atol=1e-12)


def test_shares_add_up_and_pure_slides_slide() -> None:
    A, B = motions(2, 8)
    np.testing.assert_allclose(between(A, B, 0.0), A, atol=1e-14)
    np.testing.assert_allclose(between(A, B, 1.0), B, atol=1e-14)
    half, quarter = between(A, B, 0.5), between(A, B, 0.25)
    np.testing.assert_allclose(between(A, half, 0.5), quarter, atol=1e-13)
    slide = np.column_stack([np.eye(3), [1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(screw(slide, 0.25)[:, 3], [0.25, 0.5, 0.75])
    half_circle = np.column_stack([np.diag([-1.0, -1.0, 1.0]), [2.0, 0.0, 1.0]])
    middle = screw(half_circle, 0.5)  # about the line x = 1, y = 0
    np.testing.assert_allclose(middle[:, :3] @ [1, 0, 0] + middle[:, 3], [1, 0, 0.5], atol=1e-14)


def gap(angle: float, share: float) -> float:
    """Degrees between blended dual quaternions and the screw, of a turn by `angle` rad."""
    turned = np.column_stack([Rotation.from_rotvec([0, 0, angle]).as_matrix(), [0.1, 0.2, 0.3]])
    still = np.column_stack([np.eye(3), np.zeros(3)])
    q = dual_quaternions([cs.DM(still), cs.DM(turned)])
    blend = (1 - share) * q[:, 0] + share * q[:, 1] * np.sign(float(q[:4, 0].T @ q[:4, 1]))
    corners = cs.DM(np.column_stack([np.eye(3), np.zeros(3)]))
    found = np.asarray(moved(corners, cs.repmat(blend, 1, 4)))
    R = found[:, :3] - found[:, 3:]
    away = Rotation.from_matrix(R @ between(still, turned, share)[:, :3].T)
    return float(np.degrees(away.magnitude()))


def test_blending_is_never_farther_from_the_screw_than_a_known_angle() -> None:
    """The gap grows with the angle; at 180 degrees it is 2 |atan(s / (1 - s)) - s pi / 2|.

    Its derivative vanishes where (1 - s)^2 + s^2 = 2 / pi: 8.149 degrees (the 8.15 of Kavan et
    al. 2008), found here once more by search.
    """
    almost = np.pi - 1e-9
    searched = minimize_scalar(
        lambda s: -gap(almost, s), bounds=(0, 0.5), method="bounded", options={"xatol": 1e-9}
    )
    s = (1 - np.sqrt(4 / np.pi - 1)) / 2
    largest = np.degrees(2 * abs(np.arctan(s / (1 - s)) - s * np.pi / 2))
    assert -searched.fun == pytest.approx(largest, abs=1e-6)
    assert round(largest, 3) == 8.149
    grid = [[gap(a, s) for s in np.linspace(0, 1, 41)] for a in np.linspace(0.1, almost, 12)]
    assert np.max(grid) <= largest + 1e-6
    assert (np.diff(np.max(grid, axis=1)) > 0).all()
    assert gap(almost, 0.5) < 1e-6  # halfway they agree
