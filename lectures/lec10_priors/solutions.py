"""Solutions of lecture 10."""

import numpy as np

Array = np.ndarray


def whitened(x: Array, mean: Array, C: Array) -> Array:
    return np.linalg.solve(np.linalg.cholesky(C), x - mean)


def rho(x: float, sigma: float) -> float:
    return x**2 / (sigma**2 + x**2)


def influence(x: float, sigma: float) -> float:
    return 2 * x * sigma**2 / (sigma**2 + x**2) ** 2


def shrunk(x: Array, sigma: float) -> Array:
    return x / np.sqrt(sigma**2 + x**2)


def max_mixture(x: Array, shares: Array, means: Array, covariances: Array) -> float:
    costs = [
        0.5 * np.sum(whitened(x, mean, C) ** 2) + 0.5 * np.linalg.slogdet(C)[1] - np.log(share)
        for share, mean, C in zip(shares, means, covariances, strict=True)
    ]
    return min(costs)


def weighted(x: Array, y: Array, w: Array) -> Array:
    """The line of least squares, with weights."""
    root = np.sqrt(w)
    A = np.column_stack([x, np.ones(len(x))])
    return np.linalg.lstsq(A * root[:, None], y * root, rcond=None)[0]


def line(x: Array, y: Array) -> Array:
    # of the lines through two points the one with the least median, then Geman and McClure
    best = min(
        (
            (np.median(np.abs(y - a * x - (y[i] - a * x[i]))), a, y[i] - a * x[i])
            for i in range(len(x))
            for j in range(i)
            if abs(x[i] - x[j]) > 0.1
            for a in [(y[i] - y[j]) / (x[i] - x[j])]
        ),
    )
    found, sigma = np.array(best[1:]), 0.1
    for _ in range(50):
        s = ((y - found[0] * x - found[1]) / sigma) ** 2
        found = weighted(x, y, 1 / (1 + s) ** 2)
    return found
