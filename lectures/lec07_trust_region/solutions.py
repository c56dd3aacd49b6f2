"""Solutions of lecture 7."""

import numpy as np
from scipy.optimize import brentq

Array = np.ndarray


def damped_step(e: Array, J: Array, damping: float) -> Array:
    n = J.shape[1]
    tall = np.concatenate([J, np.sqrt(damping) * np.eye(n)])  # |tall p + (e, 0)| is what is least
    return np.linalg.lstsq(tall, -np.concatenate([e, np.zeros(n)]), rcond=None)[0]


def gain(f, e: Array, J: Array, x: Array, p: Array) -> float:
    after, linear = f(x + p), e + J @ p
    return (e @ e - after @ after) / (e @ e - linear @ linear)


def cauchy_point(e: Array, J: Array) -> Array:
    g = J.T @ e
    return -(g @ g) / np.sum((J @ g) ** 2) * g


def dogleg_step(newton: Array, cauchy: Array, radius: float) -> Array:
    if np.linalg.norm(newton) <= radius:
        return newton
    if np.linalg.norm(cauchy) >= radius:
        return cauchy * radius / np.linalg.norm(cauchy)
    leg = newton - cauchy
    a, b, c = leg @ leg, cauchy @ leg, cauchy @ cauchy - radius**2
    return cauchy + leg * (-b + np.sqrt(b * b - a * c)) / a


def damping_for(e: Array, J: Array, radius: float) -> float:
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    b = U.T @ e

    def too_long(damping):
        return np.linalg.norm(s / (s**2 + damping) * b) - radius

    if too_long(0) <= 0:
        return 0.0
    enough = np.linalg.norm(J.T @ e) / radius  # |p| < |J'e| / damping
    return brentq(too_long, 0, enough, xtol=1e-300, rtol=1e-12)


def fit(f, J, x: Array) -> Array:
    e, here = f(x), J(x)
    damping, growth = 1e-3 * np.max(np.sum(here**2, axis=0)), 2.0
    for _ in range(290):
        if np.abs(here.T @ e).max() < 1e-9 or damping > 1e12:
            break
        p = damped_step(e, here, damping)
        after, linear = f(x + p), e + here @ p
        promise = e @ e - linear @ linear
        gained = (e @ e - after @ after) / promise if promise > 0 else -1.0
        if gained > 0:
            x, e, here = x + p, after, J(x + p)
            damping, growth = damping * max(0.1, 1 - (2 * gained - 1) ** 3), 2.0
        else:
            damping, growth = damping * growth, 2 * growth
    return x
