"""Least squares with a price on large blend shapes, alike for all vertices or not."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
Array = NDArray[np.float64]
RIDGES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # per pose, of what is tried


def ridge(features: Array, shapes: Array, price: float) -> Array:
    """Posedirs (N, 3, F) that minimise |A P - D|^2 + price n |P|^2: A (n, F), D (n, N, 3) m."""
    n, N = len(shapes), shapes.shape[1]
    flat = shapes.reshape(n, -1)
    F = features.shape[1]
    if n < F:  # the same by the smaller matrix
        small = features @ features.T + price * n * np.eye(n)
        solved = features.T @ np.linalg.solve(small, flat)
    else:
        gram = features.T @ features + price * n * np.eye(F)
        solved = np.linalg.solve(gram, features.T @ flat)
    return np.ascontiguousarray(solved.reshape(F, N, 3).transpose(1, 2, 0))


def local_ridge(features: Array, shapes: Array, prices: Array) -> Array:
    """The same with a price for each feature at each vertex: prices (N, F) per pose."""
    n, N = len(shapes), shapes.shape[1]
    gram = features.T @ features
    products = (features.T @ shapes.reshape(n, -1)).reshape(-1, N, 3)  # (F, N, 3)
    posedirs = np.empty((N, 3, features.shape[1]))
    diagonal = np.diag_indices_from(gram)
    for i in range(N):
        mine = gram.copy()
        mine[diagonal] += n * prices[i]
        posedirs[i] = np.linalg.solve(mine, products[:, i]).T
    return posedirs


def left_over(features: Array, shapes: Array, posedirs: Array) -> float:
    """Root mean square length of what they do not explain, m."""
    n, N = len(shapes), shapes.shape[1]
    explained = features @ posedirs.reshape(3 * N, -1).T
    return float(np.linalg.norm(shapes.reshape(n, -1) - explained) / np.sqrt(n * N))


def best(tried: Sequence[T], error: Callable[[T], float]) -> T:
    """Of some candidates the one with the least error."""
    return min(tried, key=error)
