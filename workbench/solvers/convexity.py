"""A symmetric matrix made positive definite, and by how much it had to be changed for that."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEAST = 1e-8  # of the largest eigenvalue: the least that a direction's curvature is taken for


class Convex(NamedTuple):
    """A positive definite matrix (n, n), and by how much it was changed to become one."""

    matrix: Array
    change: float


Convexify = Callable[[Array], Convex]


def shifted(H: Array) -> Convex:
    """H + tau I with the least tau that leaves no curvature below 1e-8 of the largest."""
    values = np.linalg.eigvalsh(H)
    tau = max(0.0, LEAST * float(np.abs(values).max(initial=1e-300)) - float(values.min()))
    return Convex(H + tau * np.eye(len(H)), tau)


def reflected(H: Array) -> Convex:
    """H with the signs of its eigenvalues taken away: away from a saddle, not into it."""
    values, vectors = np.linalg.eigh(H)
    least = LEAST * float(np.abs(values).max(initial=1e-300))
    if values.min() >= least:
        return Convex(H, 0.0)
    positive = np.maximum(np.abs(values), least)
    return Convex((vectors * positive) @ vectors.T, float(np.max(positive - values)))
