"""Solutions of lecture 5."""

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray


def features(R: Array) -> Array:
    return (R[1:] - np.eye(3)).ravel()


def shares(theta: Array, places: Array, width: float) -> Array:
    exponents = -np.sum((theta - places) ** 2, axis=1) / width**2
    K = np.exp(exponents - exponents.max())  # the largest is 1, so the sum is not zero
    return K / K.sum()


def solved_shapes(places: Array, shapes: Array, width: float) -> Array:
    away = places[:, None] - places
    K = np.exp(-np.sum(away**2, axis=2) / width**2)
    return np.linalg.solve(K, shapes)


def displacement(weights: Array, R: Array, rest: Array, posed: Array) -> Array:
    M = np.einsum("ik,kab->iab", weights, R)
    return np.linalg.solve(M, posed[..., None])[..., 0] - rest


def person(template: Array, shapedirs: Array, regressor: Array, lengths: Array, c: Array):
    vertices = template + shapedirs @ (c / lengths)
    return vertices, regressor @ vertices


def predict(poses: Array, shapes: Array, asked: Array) -> Array:
    def elements(vectors: Array) -> Array:
        return (Rotation.from_rotvec(vectors).as_matrix() - np.eye(3)).reshape(-1, 9)

    P = np.linalg.lstsq(elements(poses), shapes, rcond=1e-10)[0]  # a shape for each element
    return elements(asked) @ P
