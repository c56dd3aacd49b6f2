"""Solutions of lecture 2."""

from math import factorial

import casadi as cs
import numpy as np

Array = np.ndarray


def hat(w: Array) -> Array:
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rodrigues(w: Array) -> Array:
    t = np.linalg.norm(w)
    W = hat(w)
    a = np.sinc(t / np.pi)  # NumPy's sinc(x) is sin(pi x) / (pi x), and 1 at 0
    b = np.sinc(t / (2 * np.pi)) ** 2 / 2  # 2 (sin(t/2) / t)^2 = (1 - cos t) / t^2
    return np.eye(3) + a * W + b * W @ W


def angle_between(A: Array, B: Array) -> float:
    # ||A - B|| = 2 sqrt(2) sin(angle / 2); an arccos of the trace would lose half of the digits
    half = np.linalg.norm(A - B) / np.sqrt(8)
    return 2 * np.arcsin(min(1.0, half))


def shorter(w: Array) -> Array:
    t = np.linalg.norm(w)
    if t <= np.pi:
        return w
    turns = np.round(t / (2 * np.pi))
    return w * (1 - 2 * np.pi * turns / t)


def nearest_rotation(M: Array) -> Array:
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


def mean_rotation(rotations: Array) -> Array:
    # sum ||R - R_n||^2 = n ||R - mean||^2 + what does not depend on R
    return nearest_rotation(np.mean(rotations, axis=0))


def third(s: float) -> Array:
    x = cs.SX.sym("s")
    near = x < 1
    series = sum((-x) ** n / factorial(2 * n + 3) for n in range(9))
    t = cs.sqrt(cs.if_else(near, 1, x))  # the closed form never sees what is near zero
    return with_derivatives(cs.if_else(near, series, (t - cs.sin(t)) / t**3), x, s)


def with_derivatives(f: cs.SX, x: cs.SX, at: float) -> Array:
    """Value, first and second derivative of an expression in x, at a number."""
    slope = cs.jacobian(f, x)
    found = cs.Function("f", [x], [cs.vertcat(f, slope, cs.jacobian(slope, x))])
    return np.asarray(found(at)).ravel()
