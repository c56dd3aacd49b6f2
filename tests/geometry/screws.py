"""Rigid motions one after the other, and the steadiest way from one to another."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.geometry.dual_quaternions import _cross, _dot, _times
from workbench.geometry.rotation import Matrix


def screw(motion: ArrayLike, share: float) -> Array:
    """A share of a rigid motion (3, 4) m, (3, 4): turned and moved evenly about its one axis.

    Every rigid motion is a turn about a line and a slide along it (Chasles); share 0 is the
    identity, 1 the motion, and the speed is the same all the way (ScLERP). The turn is the
    shorter one; of two by 180 degrees it is either.
    """
    M = np.asarray(motion, dtype=float)
    R, t = M[:, :3], M[:, 3]
    w = Rotation.from_matrix(R).as_rotvec()
    angle = float(np.linalg.norm(w))
    if angle < 1e-12:
        return np.column_stack([np.eye(3), share * t])
    n = w / angle
    slide, across = (t @ n) * n, t - (t @ n) * n
    centre = (across + np.cross(n, across) / np.tan(angle / 2)) / 2  # (I - R) centre = across
    part = Rotation.from_rotvec(share * w).as_matrix()
    return np.column_stack([part, share * slide + centre - part @ centre])


def between(first: ArrayLike, second: ArrayLike, share: float) -> Array:
    """The motion (3, 4) that is a share of the way from the first to the second."""
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    back = a[:, :3].T
    step = np.column_stack([b[:, :3] @ back, b[:, 3] - b[:, :3] @ back @ a[:, 3]])
    part = screw(step, share)
    return np.column_stack([part[:, :3] @ a[:, :3], part[:, :3] @ a[:, 3] + part[:, 3]])


def product(a: Matrix, b: Matrix) -> Matrix:
    """Quaternions a b, (4, K) each: the rotation of b, then that of a."""
    w, r, v, s = a[0, :], a[1:, :], b[0, :], b[1:, :]
    return cs.vertcat(w * v - _dot(r, s), _times(w, s) + _times(v, r) + _cross(r, s))


def dual_product(a: Matrix, b: Matrix) -> Matrix:
    """Dual quaternions a b, (8, K) each: the motion of b, then that of a."""
    real = product(a[:4, :], b[:4, :])
    return cs.vertcat(real, product(a[:4, :], b[4:, :]) + product(a[4:, :], b[:4, :]))
