"""Exercises of lecture 18, hands.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres and angles in radians. This command grades the file:

    workbench lecture check 18 lec18_hands.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def pose_of(mean: Array, components: Array, z: Array) -> Array:
    """The pose of the fingers with coefficients z: the mean pose, and z times the components.

    mean (J, 3) rad; components (C, J, 3) rad; z (C,) -> (J, 3) rad
    """
    raise Unsolved("pose_of")


def components_needed(deviations: Array, share: float) -> int:
    """How many of the first components hold at least this share of the variance of all.

    deviations (C,), standard deviations, in descending order; share between 0 and 1 -> a whole number
    """
    raise Unsolved("components_needed")


def mirrored(vertices: Array, pose: Array) -> tuple[Array, Array]:
    """A hand and its pose in the mirror x -> -x, vertices and joints keeping their numbers.

    vertices (N, 3) m; pose (K, 3) rotation vectors in rad -> vertices (N, 3) m, pose (K, 3) rad
    """
    raise Unsolved("mirrored")


def whole_pose(body: Array, left: Array, right: Array) -> Array:
    """The pose of SMPL-H, of 52 joints, from one of SMPL and two hands.

    SMPL-H has the first 22 joints of SMPL, and then the fingers of the left and of the right hand. The two
    joints `left_hand` and `right_hand` of SMPL have no place in it.

    body (24, 3), left (15, 3), right (15, 3) rad -> (52, 3) rad
    """
    raise Unsolved("whole_pose")


def seen_turns(joints: Array, points: Array, moved_by: Array) -> int:
    """How many independent small turns of the joints of a finger are seen in some points.

    A small turn w of a joint at j moves each point p that hangs on it by w x (p - j), and no other. There
    are three numbers for each joint. The points are rigid on their bones. Singular values below 1e-9 m count
    as zero.

    joints (J, 3) m; points (M, 3) m; moved_by (M, J), whether the point hangs on the joint
    -> a whole number, up to 3 J
    """
    raise Unsolved("seen_turns")
