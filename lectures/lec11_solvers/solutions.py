"""Solutions of lecture 11."""

import numpy as np

Array = np.ndarray


def target(start: float, best: float, tau: float) -> float:
    return best + tau * (start - best)


def effort_until(costs: Array, efforts: Array, goal: float) -> float:
    below = np.flatnonzero(costs <= goal)
    return float(efforts[below[0]]) if len(below) else np.inf


def ratios(times: Array) -> Array:
    least = times.min(axis=1, keepdims=True)
    finite = np.isfinite(times)
    return np.where(finite, times / np.where(np.isfinite(least), least, 1), np.inf)


def profile(times: Array, alphas: Array) -> Array:
    r = ratios(times)
    return np.array([np.mean(r <= alpha, axis=0) for alpha in alphas])


def wilson(successes: int, trials: int) -> tuple[float, float]:
    p, n, z = successes / trials, trials, 1.96
    middle, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return (middle - half) / (1 + z**2 / n), (middle + half) / (1 + z**2 / n)


def turned_round() -> Array:
    # A leads on two problems, C on two on which B is second, B on one: C gone, B leads on three
    return np.array([[1, 2, 3], [1, 2, 3], [3, 2, 1], [3, 2, 1], [2, 1, 3]], dtype=float)
