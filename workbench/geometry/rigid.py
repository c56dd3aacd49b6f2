"""Motions of point sets, and the best rigid one between two, in closed form."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import BadArgument
from workbench.geometry.rotation import matrix_from_vector, nearest_rotation

ROUNDING = 16 * np.finfo(float).eps  # of a product of sizes: what a singular value may be off


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

    def after(self, first: "Similarity") -> "Similarity":
        """The motion that makes the motion `first`, and then this one."""
        return Similarity(self.R @ first.R, self(first.t), self.scale * first.scale)

    def inverse(self) -> "Similarity":
        """The motion that takes the moved points back. Raises BadArgument if the scale is 0."""
        if self.scale == 0:
            raise BadArgument("a motion of scale 0 takes all points to one place and not back")
        return Similarity(self.R.T, -(self.t @ self.R) / self.scale, 1 / self.scale)


def procrustes(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None
) -> Similarity:
    """The rigid motion that takes source to target, both (N, 3), with the least squared error.

    This is Kabsch's solution; the result is a rotation even for mirrored data: the sign of the
    smallest singular value changes, which costs least (Umeyama 1991). `weights` (N,) are at least
    0 and say how much each squared distance counts.

    If the data leave the rotation open, it is the smallest of those with the least error. Points
    on a line leave the turn around that line open, and the rotation found takes one line to the
    other about an axis at right angles to both. If all points of the source or of the target are at
    one place, the rotation is the identity. Mirrored data may have several best rotations, as those
    of a cube have, and one of them is returned.

    Raises BadArgument if the arrays do not fit together, hold numbers that are not finite, or if no
    weight is above 0.
    """
    p, q = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    w = np.ones(len(p)) if weights is None else np.asarray(weights, dtype=float)
    _check(p, q, w)
    w = w / w.sum()
    p0, q0 = w @ p, w @ q
    a, b = p - p0, q - q0
    covariance: Array = b.T @ (w[:, None] * a)
    sizes = [float(np.sqrt((w @ x**2).sum())) for x in (b, a)]
    reaches = [float(np.abs(x[w > 0]).max()) for x in (p, q)]
    rounding = ROUNDING * (reaches[0] * sizes[0] + reaches[1] * sizes[1])
    U, spread, Vt = np.linalg.svd(covariance)
    if spread[0] <= rounding:
        R = np.eye(3)
    elif spread[1] <= rounding:
        R = _from_line_to_line(Vt[0], U[:, 0])
    else:
        R = nearest_rotation(covariance)
    return Similarity(R, q0 - R @ p0)


def _from_line_to_line(a: Array, b: Array) -> Array:
    """The smallest rotation that takes the unit vector a to b; if b = -a, one of the half-turns."""
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine <= ROUNDING:
        if cosine > 0:
            return np.eye(3)
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])  # at right angles to a
    return matrix_from_vector(np.arctan2(sine, cosine) / np.linalg.norm(axis) * axis)


def _check(p: Array, q: Array, w: Array) -> None:
    if p.ndim != 2 or p.shape[1:] != (3,) or not len(p):
        raise BadArgument(f"the source must be points (N, 3), at least one, not of shape {p.shape}")
    if q.shape != p.shape:
        raise BadArgument(
            f"the target has shape {q.shape} and the source {p.shape}; give one target point for "
            "each source point"
        )
    if w.shape != (len(p),):
        raise BadArgument(
            f"the weights must be {len(p)} numbers, one for each point, not {w.shape}"
        )
    if not (np.isfinite(p).all() and np.isfinite(q).all()):
        raise BadArgument("a point has a coordinate that is not finite; leave such points out")
    if not np.isfinite(w).all() or (w < 0).any() or not w.any():
        raise BadArgument("the weights must be finite and at least 0, and one of them above 0")
