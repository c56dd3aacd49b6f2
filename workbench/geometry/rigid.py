"""Rigid motions of point sets: the best one between two, in closed form."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.geometry.rotation import nearest_rotation


@dataclass(frozen=True, eq=False)
class Similarity:
    """p -> scale R p + t; rigid when the scale is 1.

    Attributes:
        R: (3, 3) rotation.
        t: (3,) m.
        scale: the factor; 1 for rigid motions.
    """

    R: Array
    t: Array
    scale: float = 1.0

    def __call__(self, points: ArrayLike) -> Array:
        """The points (..., 3) m after the motion."""
        return self.scale * np.asarray(points, dtype=float) @ self.R.T + self.t


def procrustes(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None
) -> Similarity:
    """The rigid motion that takes source to target, both (N, 3), with the least squared error.

    This is Kabsch's solution; the result is a rotation even for mirrored data (Umeyama 1991).
    """
    p, q = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    w = np.ones(len(p)) if weights is None else np.asarray(weights, dtype=float)
    w = w / w.sum()
    p0, q0 = w @ p, w @ q
    R = nearest_rotation((q - q0).T @ (w[:, None] * (p - p0)))
    return Similarity(R, q0 - R @ p0)


def segment_motions(source: Array, target: Array, weights: Array) -> list[Similarity]:
    """The rigid motion of each of K segments, by `procrustes` with its row of weights (K, N)."""
    return [procrustes(source, target, w) for w in weights]
