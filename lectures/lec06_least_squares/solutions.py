"""Solutions of lecture 6."""

import numpy as np

Array = np.ndarray

UPPER, LOWER, HAND = 0.30, 0.25, 0.18  # m


def residual(x: Array, seen: Array) -> Array:
    along = np.cumsum(x)  # a, a + b, a + b + c: where each bone points
    bones = np.array([UPPER, LOWER, HAND]) * [np.cos(along), np.sin(along)]  # (2, 3)
    return np.cumsum(bones, axis=1).T.ravel() - seen


def jacobian(x: Array) -> Array:
    along = np.cumsum(x)
    turned = (np.array([UPPER, LOWER, HAND]) * [-np.sin(along), np.cos(along)]).T  # (3, 2)
    J = np.zeros((6, 3))
    for k in range(3):  # the k-th angle turns the k-th bone and all after it
        for i in range(k, 3):
            J[2 * i : 2 * i + 2, k] = turned[k : i + 1].sum(axis=0)
    return J


def gradient(e: Array, J: Array) -> Array:
    return 2 * J.T @ e


def numeric_jacobian(f, x: Array) -> Array:
    h = 1e-5  # the error is of order h^2 + eps / h
    columns = [(f(x + h * one) - f(x - h * one)) / (2 * h) for one in np.eye(len(x))]
    return np.column_stack(columns)


def gauss_newton_step(e: Array, J: Array) -> Array:
    return np.linalg.lstsq(J, -e, rcond=None)[0]  # J'J would square the condition


def left_out(x: Array, seen: Array) -> float:
    tip = UPPER * np.array([np.cos(x[0]), np.sin(x[0])])
    return (tip - seen) @ -tip / UPPER**2  # the second derivative of the tip is minus the tip


def fit(f, J, x: Array) -> Array:
    for _ in range(500):
        e, here = f(x), J(x)
        slope = here.T @ e
        if np.abs(slope).max() < 1e-9:
            break
        p = gauss_newton_step(e, here)
        length = 1.0
        while length > 1e-12:
            trial = f(x + length * p)
            if trial @ trial <= e @ e + 1e-4 * length * 2 * slope @ p:
                break
            length /= 2
        x = x + length * p
    return x
