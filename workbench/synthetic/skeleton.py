"""The 24 joints of SMPL, and linear blend skinning on them in NumPy."""

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


def joint_positions(R: Array, joints: Array) -> Array:
    """Where joints are, (24, 3) m, whose bones have world rotations R (24, 3, 3).

    `joints` (24, 3) m are their positions without rotations; the root stays where it is.
    """
    placed = joints.copy()
    for k, parent in enumerate(PARENTS[1:], start=1):
        placed[k] = placed[parent] + R[parent] @ (joints[k] - joints[parent])
    return placed


def offsets(R: Array, placed: Array, joints: Array) -> Array:
    """The offsets o (n, 3) m of the rigid motions v -> R v + o that take `joints` to `placed`."""
    moved: Array = placed - (R @ joints[..., None])[..., 0]
    return moved


def blended(weights: Array, R: Array, shifts: Array) -> tuple[Array, Array]:
    """The blended motion of each vertex: sum_k w_ik R_k (N, 3, 3) and sum_k w_ik o_k (N, 3)."""
    return blend_matrices(weights, R), weights @ shifts


def unskin(posed: Array, M: Array, m: Array) -> Array:
    """The points (N, 3) m that linear blend skinning takes to `posed`: its exact inverse."""
    rest = np.linalg.solve(M, (posed - m)[..., None])[..., 0]
    return rest.astype(np.float64, copy=False)
