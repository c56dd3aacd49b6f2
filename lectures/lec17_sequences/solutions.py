"""Solutions of lecture 17."""

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

Array = np.ndarray


def smooth_residual(x: Array, sigma: float, order: int) -> Array:
    return np.diff(x, order, axis=0).ravel() / sigma


def worth(r: Array) -> float:
    T = len(r)
    k = np.arange(1, T)
    return T / (1 + 2 * np.sum((1 - k / T) * r[1:]))


def worth_of_errors(errors: Array) -> float:
    # T sum of x[t]^2 over the sum of x[s] x[t] for all pairs, which is (sum of x[t])^2
    return len(errors) * np.sum(errors**2) / np.sum(errors.sum(axis=0) ** 2)


def arrow_solve(D: Array, B: Array, C: Array, f: Array, g: Array) -> tuple[Array, Array]:
    S, right, known = C.copy(), g.copy(), []
    for Dt, Bt, ft in zip(D, B, f, strict=True):
        Y = np.linalg.solve(Dt, np.column_stack([Bt, ft]))
        S -= Bt.T @ Y[:, :-1]
        right -= Bt.T @ Y[:, -1]
        known.append(Y)
    s = np.linalg.solve(S, right)
    return np.array([Y[:, -1] - Y[:, :-1] @ s for Y in known]), s


def axes(corners: Array) -> Array:
    """The axes of the frame of three vertices, as columns (3, 3)."""
    a, b, c = corners
    first = (b - a) / np.linalg.norm(b - a)
    across = np.cross(b - a, c - a)
    third = across / np.linalg.norm(across)
    return np.column_stack([first, np.cross(third, first), third])


def carried(rest: Array, posed: Array, marker: Array) -> Array:
    return posed[0] + axes(posed) @ axes(rest).T @ (marker - rest[0])


def filled(y: Array, sigma: float, tau: float) -> Array:
    T = len(y)
    there = np.isfinite(y)
    bend = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(T - 2, T))  # second differences
    A = diags_array(there / sigma**2) + bend.T @ bend / tau**2
    return spsolve(csc_array(A), np.where(there, y, 0.0) / sigma**2)
