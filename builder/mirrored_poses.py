"""Poses as seen in a mirror: what is learned of poses is the same on both sides."""

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.geometry.mirror import AXIAL, opposites
from workbench.priors.recordings import PoseRecording


def mirrored_pose(pose: Array, joints: Index) -> Array:
    """Poses (..., K, 3) rad as seen in a mirror; `joints` (K,) are the opposites."""
    mirrored: Array = pose[..., joints, :] * AXIAL
    return mirrored


def both_ways(mocap: PoseRecording) -> tuple[Array, Mask]:
    """The frames of a recording and their mirror images without the root, (2 F, 3 (K - 1)) rad.

    The second array (K - 1,) says which joints do not move in any of them.
    """
    turned = mirrored_pose(mocap.poses, opposites(mocap.joint_names))
    both = np.concatenate([mocap.poses, turned])[:, 1:]
    still: Mask = (np.ptp(both, axis=0) < 1e-6).all(axis=1)
    return both.reshape(len(both), -1), still
