"""Solutions of lecture 14."""

import numpy as np

Array = np.ndarray


def frame(T: Array) -> Array:
    e0, e1 = T[2] - T[0], T[1] - T[0]
    n = np.cross(e1, e0)
    return np.column_stack([e0, e1, n / np.sqrt(np.linalg.norm(n))])


def deformation(T: Array, V: Array) -> Array:
    return frame(V) @ np.linalg.inv(frame(T))


def edge_matrix(faces: Array, N: int) -> Array:
    A = np.zeros((2 * len(faces), N))
    for f, (a, b, c) in enumerate(faces):
        A[2 * f, [c, a]] = 1, -1
        A[2 * f + 1, [b, a]] = 1, -1
    return A


def stitch(A: Array, e: Array) -> Array:
    V = np.linalg.lstsq(A, e, rcond=None)[0]
    return V - V.mean(axis=0)


def blend_volume(w: float, alpha: float) -> float:
    # across the axis the blend is a complex number, w + (1 - w) exp(i alpha); along it, 1
    return abs(w + (1 - w) * np.exp(1j * alpha)) ** 2


def explained(people: Array, k: int) -> float:
    s = np.linalg.svd(people - people.mean(axis=0), compute_uv=False)
    return np.sum(s[:k] ** 2) / np.sum(s**2)
