"""Solutions of lecture 6."""

import numpy as np

Array = np.ndarray

UPPER, LOWER = 0.30, 0.25  # m


def residual(x: Array, seen: Array) -> Array:
    a, b = x
    elbow = UPPER * np.array([np.cos(a), np.sin(a)])
    wrist = elbow + LOWER * np.array([np.cos(a + b), np.sin(a + b)])
    return np.concatenate([elbow, wrist]) - seen


def jacobian(x: Array) -> Array:
    a, b = x
    by_a = UPPER * np.array([-np.sin(a), np.cos(a)])
    by_b = LOWER * np.array([-np.sin(a + b), np.cos(a + b)])
    return np.column_stack([np.concatenate([by_a, by_a + by_b]), np.concatenate([[0, 0], by_b])])


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
