"""Motions between their frames: rotations along the shortest arc, everything else along a line."""

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index


def between(values: Array, at: Array) -> Array:
    """Values (T, ...) at fractional frames (S,), linear from frame to frame: (S, ...)."""
    before, after, share = _neighbours(len(values), at)
    shares = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[before] * (1 - shares) + values[after] * shares)


def rotations_between(pose: Array, at: Array) -> Array:
    """Rotation vectors (T, K, 3) rad at fractional frames (S,): (S, K, 3) rad.

    From a to b, R(s) = R_a exp(s log(R_a' R_b)), which turns at a constant speed about one axis by
    at most half a turn (slerp: Shoemake, Animating Rotation with Quaternion Curves, 1985). At whole
    frames the vectors are those that were given.
    """
    before, after, share = _neighbours(len(pose), at)
    first, second = pose[before], pose[after]
    a, b = (Rotation.from_rotvec(v.reshape(-1, 3)) for v in (first, second))
    way = (a.inv() * b).as_rotvec().reshape(first.shape)
    turned = a * Rotation.from_rotvec((share[:, None, None] * way).reshape(-1, 3))
    found = turned.as_rotvec().reshape(first.shape)
    return np.asarray(np.where((share > 0)[:, None, None], found, first))


def _neighbours(T: int, at: Array) -> tuple[Index, Index, Array]:
    """The frames before and after, (S,), and how far it is from the one to the other, 0 to 1."""
    before: Index = np.clip(np.floor(at).astype(np.int64), 0, T - 1)
    return before, np.minimum(before + 1, T - 1), np.clip(at - before, 0.0, 1.0)
