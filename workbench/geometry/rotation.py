"""Rotations of three-space: the exponential map in CasADi, and plain arrays around it."""

from math import factorial
from typing import TypeVar

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from workbench.arrays import Array

Matrix = TypeVar("Matrix", cs.MX, cs.SX, cs.DM)

SERIES_BELOW = 0.25  # of the squared angle: there the series' ninth term is below 1e-19
SERIES_TERMS = 8
TINY = 1e-150  # rad: squares of smaller numbers are rounded to zero


def rodrigues(w: Matrix) -> Matrix:
    r"""The rotations exp([w]x) of rotation vectors in radians: (3, K) -> (3, 3 K), side by side.

    With t = |w| and [w]x the matrix of v -> w x v (Rodrigues' formula, SMPL eq. 1 corrected):

        R = cos(t) I + a [w]x + b w w',   a = sin(t) / t,   b = (1 - cos(t)) / t^2

    (the same as I + a [w]x + b [w]x^2, because [w]x^2 = w w' - t^2 I). The closed forms lose
    their derivatives at t = 0, so a, b and cos are taken as series in t^2 there; elsewhere b
    is written 2 (sin(t/2) / t)^2, which does not cancel. Both branches of a CasADi
    `if_else` are evaluated, hence the guarded argument of the closed one.
    """
    x, y, z = w[0, :], w[1, :], w[2, :]
    t2 = x**2 + y**2 + z**2  # (1, K) rad^2
    a, b = sine_and_cosine_ratios(t2)
    c = _cosine(t2)
    columns_of_each = cs.vertcat(
        c + b * x * x,
        b * x * y + a * z,
        b * x * z - a * y,
        b * x * y - a * z,
        c + b * y * y,
        b * y * z + a * x,
        b * x * z + a * y,
        b * y * z - a * x,
        c + b * z * z,
    )  # (9, K): each rotation column by column
    return cs.reshape(columns_of_each, 3, 3 * w.shape[1])


def sine_and_cosine_ratios(t2: Matrix) -> tuple[Matrix, Matrix]:
    """sin(t) / t and (1 - cos(t)) / t^2 of squared angles t^2 in rad^2; see `rodrigues`."""
    near = t2 < SERIES_BELOW
    t = cs.sqrt(cs.if_else(near, 1.0, t2))
    a = cs.if_else(near, _series(t2, 1), cs.sin(t) / t)
    return a, cs.if_else(near, _series(t2, 2), 2 * (cs.sin(t / 2) / t) ** 2)


def quaternions_of_vectors(w: Matrix) -> Matrix:
    """The quaternions (cos t/2, n sin t/2), (4, K), of rotation vectors n t (3, K) in radians.

    Smooth everywhere; a full turn further is the opposite quaternion, of the same rotation.
    """
    h2 = cs.sum1(w**2) / 4  # (1, K), the squared half angle
    a, _ = sine_and_cosine_ratios(h2)
    return cs.vertcat(_cosine(h2), cs.repmat(a / 2, 3, 1) * w)


def _cosine(t2: Matrix) -> Matrix:
    """cos(t) of squared angles t^2 in rad^2."""
    near = t2 < SERIES_BELOW
    return cs.if_else(near, _series(t2, 0), cs.cos(cs.sqrt(cs.if_else(near, 1.0, t2))))


def _series(t2: Matrix, first: int) -> Matrix:
    """Sum over n of (-t2)^n / (2 n + first)!: cos t, sin t / t, (1 - cos t) / t^2 for 0, 1, 2."""
    total = 0 * t2
    for n in reversed(range(SERIES_TERMS + (first == 0))):
        total = total * t2 + (-1) ** n / factorial(2 * n + first)
    return total


# [e]x, row by row, of the three unit vectors e
CROSS = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2).reshape(3, 9)


def crossed(w: Array) -> Array:
    """The matrix [w]x (..., 3, 3) of the cross product v -> w x v."""
    matrices: Array = w.reshape(-1, 3) @ CROSS
    return matrices.reshape(*w.shape, 3)


def matrix_from_vector(w: ArrayLike) -> Array:
    """The rotation matrices (..., 3, 3) of rotation vectors t n (..., 3) in rad; see `rodrigues`.

    They are cos(t) I + sin(t) [n]x + (1 - cos(t)) n n', in which nothing cancels where t is small.
    """
    _, n, sine, less = _angles(np.asarray(w, dtype=float))
    return _about(n, 1 - less, sine, less)


def vector_from_matrix(R: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) -> rotation vectors (..., 3), angle in [0, pi]."""
    R = np.asarray(R, dtype=float)
    return Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(*R.shape[:-2], 3)


def left_jacobian(w: ArrayLike) -> Array:
    r"""How rotations turn as their vectors (..., 3) rad change by d: exp(w + d) = exp(L d) exp(w).

    To first order, with w = t n and the left Jacobian of SO(3), of shape (..., 3, 3),

        L = sin(t) / t I + (1 - cos(t)) / t [n]x + (1 - sin(t) / t) n n'

    (Sola, Deray and Atchuthan, A micro Lie theory for state estimation in robotics, 2018, eq. 145).
    """
    t, n, sine, less = _angles(np.asarray(w, dtype=float))
    return _about(n, sine / t, less / t, 1 - sine / t)


def _angles(w: Array) -> tuple[Array, Array, Array, Array]:
    """t, n, sin(t) and 1 - cos(t) of rotation vectors t n (..., 3) rad; n is zero at zero."""
    t = np.maximum(np.linalg.norm(w, axis=-1), TINY)
    return t, w / t[..., None], np.sin(t), 2 * np.sin(t / 2) ** 2


def _about(n: Array, unit: Array, cross: Array, outer: Array) -> Array:
    """unit I + cross [n]x + outer n n', (..., 3, 3), for axes n (..., 3)."""
    matrices = cross[..., None, None] * crossed(n)
    matrices += (outer[..., None] * n)[..., :, None] * n[..., None, :]
    matrices.reshape(*n.shape[:-1], 9)[..., ::4] += unit[..., None]
    return matrices


def inverse_left_jacobian(w: ArrayLike) -> Array:
    r"""How rotation vectors (..., 3) rad move with a small turn u before them: (..., 3, 3).

    log(exp(u) exp(w)) = w + S u + ..., where S is the inverse of the left Jacobian of SO(3),

        S = c I - t / 2 [n]x + (1 - c) n n',   c = t / 2 cot(t / 2),   w = t n

    (Sola, Deray and Atchuthan, A micro Lie theory for state estimation in robotics, 2018, eq. 146).
    Near a full turn it grows without bound: there log is not unique.
    """
    t, n, _, _ = _angles(np.asarray(w, dtype=float))
    unit = t / 2 / np.tan(t / 2)
    return _about(n, unit, -t / 2, 1 - unit)


def nearest_rotation(M: ArrayLike) -> Array:
    """The rotation nearest to each 3 x 3 matrix in the Frobenius norm: (..., 3, 3).

    U diag(1, 1, det(U V')) V' from the singular value decomposition; a reflection becomes
    a rotation (Umeyama, IEEE PAMI 13(4), 1991).
    """
    U, _, Vt = np.linalg.svd(np.asarray(M, dtype=float))
    signs = np.ones(U.shape[:-1])
    signs[..., 2] = np.linalg.det(U @ Vt)
    return np.asarray((U * np.sign(signs)[..., None, :]) @ Vt)


def wrapped_to_pi(rotations: Array) -> Array:
    """The same rotations by vectors (..., 3) rad of at most pi: theta - 2 pi k theta / |theta|.

    At |theta| = 2 pi the exponential map has rank 1, and solvers that come near do not leave.
    """
    angles = np.linalg.norm(rotations, axis=-1, keepdims=True)
    turns = np.round(angles / (2 * np.pi))
    return np.asarray(rotations * (1 - 2 * np.pi * turns / np.where(angles > 0, angles, 1.0)))
