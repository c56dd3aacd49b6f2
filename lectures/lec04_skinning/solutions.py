"""Solutions of lecture 4."""

import numpy as np

Array = np.ndarray


def blend(points: Array, motions: Array, weights: Array) -> Array:
    M = np.einsum("nk,kij->nij", weights, motions)  # one (3, 4) for each point
    return np.einsum("nij,nj->ni", M[:, :, :3], points) + M[:, :, 3]


def radius_left(weight: float, angle: float) -> float:
    return np.sqrt(1 - 4 * weight * (1 - weight) * np.sin(angle / 2) ** 2)


def volume_lost(area: float, zone: float, angle: float) -> float:
    # areas shrink by the square of the radius; w (1 - w) integrates to zone / 6
    return area * zone * np.sin(angle / 2) ** 2 * 2 / 3


def blended_turn(weight: float, angle: float) -> float:
    return 2 * np.arctan2(weight * np.sin(angle / 2), 1 - weight + weight * np.cos(angle / 2))


def blend_quaternions(Q: Array, weights: Array) -> Array:
    side = np.where(Q @ Q[np.argmax(weights)] < 0, -1.0, 1.0)
    q = (weights * side) @ Q
    return q / np.linalg.norm(q)


def weights(s: Array) -> Array:
    # two neighbours at a time, 45 degrees apart: cos(22.5 degrees) = 0.92 is the worst
    return np.maximum(0, 1 - np.abs(4 * s[:, None] - np.arange(5)))


def laplacian(edges: Array, lengths: Array, vertices: int) -> Array:
    """L (N, N) of a graph; each edge counts 1 / length^2."""
    L = np.zeros((vertices, vertices))
    for (i, j), length in zip(edges, lengths, strict=True):
        L[[i, j], [j, i]] -= 1 / length**2
        L[[i, j], [i, j]] += 1 / length**2
    return L


def first_weights(segments: Array, edges: Array, lengths: Array, border: float) -> Array:
    L = laplacian(edges, lengths, len(segments))
    return np.linalg.solve(np.eye(len(L)) + border**2 * L / 2, np.eye(segments.max() + 1)[segments])
