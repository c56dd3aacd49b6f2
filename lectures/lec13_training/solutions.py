"""Solutions of lecture 13."""

import numpy as np
from scipy.optimize import nnls

Array = np.ndarray


def taught_by() -> dict[str, str]:
    of_pose = dict.fromkeys(("posedirs", "weights", "J_regressor"), "multi-pose")
    return of_pose | dict.fromkeys(("template", "shapedirs"), "multi-shape")


def unevenness(T: Array, opposite: Array) -> float:
    return float(np.sum((T - T[opposite] * [-1, 1, 1]) ** 2))


def ridge(F: Array, D: Array, penalty: float) -> Array:
    return np.linalg.solve(F.T @ F + penalty * np.eye(F.shape[1]), F.T @ D).T


def shape_space(people: Array, B: int):
    mean = people.mean(axis=0)
    _, s, Vt = np.linalg.svd(people - mean, full_matrices=False)
    return mean, (Vt[:B] * s[:B, None] / np.sqrt(len(people) - 1)).T


def weights_of(reached: Array, seen: Array) -> Array:
    # with sum w = 1 the residual is sum w_k (reached_k - seen); least |A w|^2 over w >= 0 with the
    # row of ones asking for 1 has the direction of the answer, and is then scaled to sum one
    A = (reached - seen[:, None]).transpose(0, 2, 1).reshape(-1, reached.shape[1])
    A = A / np.abs(A).max()
    w, _ = nnls(np.vstack([A, np.ones(A.shape[1])]), np.append(np.zeros(len(A)), 1.0))
    return w / w.sum()


def aligned(T: Array, V: Array) -> Array:
    """V, moved rigidly onto T."""
    a, b = T - T.mean(axis=0), V - V.mean(axis=0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    return b @ (U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt).T


def rest_shape(meshes: Array) -> Array:
    T = meshes[0] - meshes[0].mean(axis=0)
    for _ in range(500):
        better = np.mean([aligned(T, V) for V in meshes], axis=0)
        if np.abs(better - T).max() < 1e-12:
            break
        T = better
    return T
