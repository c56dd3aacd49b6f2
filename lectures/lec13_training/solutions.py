"""Solutions of lecture 13."""

import numpy as np
from scipy.optimize import nnls

Array = np.ndarray


def unposed(M: Array, m: Array, V: Array) -> Array:
    return np.linalg.solve(M, (V - m)[..., None])[..., 0]


def pose_blend_shapes(X: Array, D: Array, price: float) -> Array:
    return np.linalg.solve(X.T @ X + price * np.eye(X.shape[1]), X.T @ D)


def taught_by() -> dict[str, str]:
    return {
        "P": "multi-pose", "W": "multi-pose", "J": "multi-pose",
        "T": "multi-shape", "S": "multi-shape",
    }  # fmt: skip


def shape_directions(people: Array, k: int) -> Array:
    _, s, Vt = np.linalg.svd(people - people.mean(axis=0), full_matrices=False)
    return s[:k, None] * Vt[:k] / np.sqrt(len(people) - 1)


def joint_shares(V: Array, joints: Array) -> Array:
    # with the sum 1, w V - j is w (V - j); the row of ones then finds the scale, and is exact
    A = (V - joints[:, None]).transpose(0, 2, 1).reshape(-1, V.shape[1])
    A = np.concatenate([A / np.abs(A).max(), np.ones((1, A.shape[1]))])
    w, _ = nnls(A, np.eye(len(A))[-1], maxiter=100 * A.shape[1])
    return w / w.sum()


def nearest(M: Array) -> Array:
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


def shape_of(scans: Array) -> Array:
    T = scans[0]
    for _ in range(100):
        T = np.mean([scan @ nearest(scan.T @ T) for scan in scans], axis=0)
    return T
