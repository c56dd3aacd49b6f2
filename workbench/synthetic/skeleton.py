"""The 24 joints of SMPL, and the inverse of linear blend skinning on any joints, in NumPy."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.bodies.files.joint_names import joint_names
from workbench.bodies.forward.skinning import blend_matrices
from workbench.geometry.mirror import opposites

JOINT_NAMES = joint_names(24)
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
MIRRORED_JOINTS = opposites(JOINT_NAMES)
N_JOINTS = len(JOINT_NAMES)
JOINT = {name: k for k, name in enumerate(JOINT_NAMES)}


def joint_positions(R: Array, joints: Array, parents: Sequence[int] = PARENTS) -> Array:
    """Where joints are, (K, 3) m, whose bones have world rotations R (K, 3, 3).

    `joints` (K, 3) m are their positions without rotations; the root stays where it is.
    """
    placed = joints.copy()
    for k, parent in enumerate(parents[1:], start=1):
        placed[k] = placed[parent] + R[parent] @ (joints[k] - joints[parent])
    return placed


def offsets(R: Array, placed: Array, joints: Array) -> Array:
    """The offsets o (n, 3) m of the rigid motions v -> R v + o that take `joints` to `placed`."""
    moved: Array = placed - (R @ joints[..., None])[..., 0]
    return moved


def unskin(posed: Array, weights: Array, R: Array, shifts: Array) -> Array:
    """The points (N, 3) m that linear blend skinning takes to `posed`: its exact inverse.

    The motion of joint k is v -> R_k v + o_k, with rotations R (K, 3, 3) and `shifts` o (K, 3) m.
    """
    turned = (posed - weights @ shifts)[..., None]
    return np.asarray(np.linalg.solve(blend_matrices(weights, R), turned)[..., 0])
