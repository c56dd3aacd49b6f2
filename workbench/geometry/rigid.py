"""Motions of point sets: the best one between two, rigid or with a scale, in closed form."""

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
    pair = _Centred(source, target, weights)
    R = _best_rotation(pair.covariance, pair.rounding)
    return Similarity(R, pair.q0 - R @ pair.p0)


def umeyama(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> Similarity:
    """The motion with a scale that takes source to target, both (N, 3), with least squared error.

    The rotation is that of `procrustes`, and the scale is trace(R' M) / sum w |p - p0|^2 with M the
    covariance sum w (q - q0) (p - p0)' (Umeyama 1991, eq. 41-43). The scale is never negative; it
    is 0 if all points of the target are at one place, and 1, as nothing determines it, if all of
    the source are. Exchanging source and target does not give the inverse scale unless the data fit
    without error. Raises BadArgument as `procrustes` does.
    """
    pair = _Centred(source, target, weights)
    R = _best_rotation(pair.covariance, pair.rounding)
    scale = 1.0
    if pair.size_p > ROUNDING * pair.reach_p:
        scale = max(0.0, float(np.sum(R * pair.covariance)) / pair.size_p**2)
    return Similarity(R, pair.q0 - scale * R @ pair.p0, scale)


class _Centred:
    """Two point sets about their weighted means p0 and q0, with what rounding does to them."""

    def __init__(self, source: ArrayLike, target: ArrayLike, weights: ArrayLike | None) -> None:
        p, q = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
        w = np.ones(len(p)) if weights is None else np.asarray(weights, dtype=float)
        _check(p, q, w)
        w = w / w.sum()
        self.p0, self.q0 = w @ p, w @ q
        a, b = p - self.p0, q - self.q0
        self.covariance: Array = b.T @ (w[:, None] * a)
        self.size_p, self.size_q = (float(np.sqrt((w @ x**2).sum())) for x in (a, b))
        counted = w > 0
        self.reach_p, self.reach_q = (float(np.abs(x[counted]).max()) for x in (p, q))
        self.rounding = ROUNDING * (self.reach_p * self.size_q + self.reach_q * self.size_p)


def _best_rotation(covariance: Array, rounding: float) -> Array:
    """The rotation with the largest trace(R' M), and of several the smallest."""
    U, spread, Vt = np.linalg.svd(covariance)
    if spread[0] <= rounding:
        return np.eye(3)
    if spread[1] <= rounding:
        return _from_line_to_line(Vt[0], U[:, 0])
    return nearest_rotation(covariance)


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
