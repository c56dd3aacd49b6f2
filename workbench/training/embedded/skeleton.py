"""The 24 joints of SMPL, and their motions, in plain numbers."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.bodies.skinning import blend_matrices
from workbench.training.mirror import opposites

Array = NDArray[np.float64]

JOINT_NAMES = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar"),
    *("right_collar", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist", "left_hand", "right_hand"),
)
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
MIRRORED_JOINTS = opposites(JOINT_NAMES)
N_JOINTS = len(JOINT_NAMES)
JOINT = {name: k for k, name in enumerate(JOINT_NAMES)}


def local_rotations(pose: Array) -> Array:
    """Rotation vectors (..., K, 3) rad as matrices (..., K, 3, 3)."""
    matrices: Array = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix()
    return matrices.reshape(*pose.shape, 3)


def pose_features(pose: Array) -> Array:
    """vec(R_k - I) row by row of every joint but the root: (..., K, 3) -> (..., 9 (K - 1))."""
    difference = local_rotations(pose)[..., 1:, :, :] - np.eye(3)
    return difference.reshape(*pose.shape[:-2], -1)


def world_motions(local: Array, joints: Array) -> tuple[Array, Array]:
    """World rotations (..., K, 3, 3) and positions (..., K, 3) m of the posed joints."""
    R = local.copy()
    t = np.broadcast_to(joints, R.shape[:-1]).copy()
    for k, parent in enumerate(PARENTS[1:], start=1):
        R[..., k, :, :] = R[..., parent, :, :] @ local[..., k, :, :]
        t[..., k, :] = t[..., parent, :] + R[..., parent, :, :] @ (joints[k] - joints[parent])
    return R, t


def binding_motions(pose: Array, joints: Array) -> tuple[Array, Array]:
    """G'_k as rotations (..., K, 3, 3) and offsets (..., K, 3) m: a rest point v -> R v + o."""
    R, t = world_motions(local_rotations(pose), joints)
    return R, t - (R @ joints[..., None])[..., 0]


def blended(weights: Array, R: Array, offsets: Array) -> tuple[Array, Array]:
    """The motion of each vertex, M_i = sum_k w_ik R_k (N, 3, 3) and m_i (N, 3) m likewise."""
    return blend_matrices(weights, R), weights @ offsets


def skin(points: Array, M: Array, m: Array) -> Array:
    """Linear blend skinning: M_i v_i + m_i, (N, 3) m."""
    posed: Array = (M @ points[..., None])[..., 0] + m
    return posed


def unskin(posed: Array, M: Array, m: Array) -> Array:
    """The points (N, 3) m that linear blend skinning takes to `posed`: its exact inverse."""
    rest = np.linalg.solve(M, (posed - m)[..., None])[..., 0]
    return rest.astype(np.float64, copy=False)
