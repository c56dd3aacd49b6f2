"""Solutions of lecture 5."""

import numpy as np
from scipy.optimize import nnls

Array = np.ndarray


def kernels(x: Array, examples: Array, width: float) -> Array:
    """exp(-|x - x_i|^2 / width^2), for x (..., D): (..., n)."""
    away = x[..., None, :] - examples
    return np.exp(-np.sum(away**2, axis=-1) / width**2)


def shares(x: Array, examples: Array, width: float) -> Array:
    k = kernels(x, examples, width)
    return k / k.sum()


def exact(x: Array, examples: Array, width: float) -> Array:
    return np.linalg.solve(kernels(examples, examples, width), kernels(x, examples, width))


def features(R: Array) -> Array:
    return (R[1:] - np.eye(3)).ravel()


def learn(F: Array, D: Array, ridge: float) -> Array:
    return np.linalg.solve(F.T @ F + ridge * np.eye(F.shape[1]), F.T @ D)


def directions(people: Array, k: int) -> tuple[Array, Array]:
    mean = people.mean(axis=0)
    _, s, Vt = np.linalg.svd(people - mean, full_matrices=False)
    return mean, Vt[:k].T * s[:k] / np.sqrt(len(people) - 1)


def regressor(people: Array, joints: Array) -> Array:
    A = people.transpose(0, 2, 1).reshape(-1, people.shape[1])  # (3 n, N)
    strong = 1e3 * np.ones((1, A.shape[1]))  # the sum, as one more equation
    w, _ = nnls(np.vstack([A, strong]), np.r_[joints.ravel(), 1e3])
    return w / w.sum()


def mixed(
    mean_1: Array, C_1: Array, mean_2: Array, C_2: Array, share: float
) -> tuple[Array, Array]:
    d = mean_2 - mean_1
    within = share * C_1 + (1 - share) * C_2
    return share * mean_1 + (1 - share) * mean_2, within + share * (1 - share) * np.outer(d, d)
