"""From the artist's A-pose to SMPL's T-pose, by the exact inverse of linear blend skinning."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.geometry.mirror import REFLECTION
from workbench.synthetic.skeleton import (
    JOINT,
    N_JOINTS,
    joint_positions,
    offsets,
    unskin,
)

X, DOWN, FRONT = np.array([1.0, 0, 0]), np.array([0, -1.0, 0]), np.array([0, 0, 1.0])
THIGH = np.array([0.05, -1.0, 0])  # the left thigh of the T-pose leaves the hip slightly outwards


@dataclass(frozen=True, eq=False)
class RestPose:
    """One person in the T-pose: `vertices` (N, 3) m and `joints` (24, 3) m, pelvis at the origin.

    `rotations` (24, 3, 3) took each joint from the A-pose to the T-pose.
    """

    vertices: Array
    joints: Array
    rotations: Array


def direction(v: Array) -> Array:
    """The vector scaled to unit length."""
    unit: Array = v / np.linalg.norm(v)
    return unit


def frame(first: Array, second: Array) -> Array:
    """The orthonormal frame (3, 3) whose columns begin along `first` and lean to `second`."""
    x = direction(first)
    y = direction(second - x * (x @ second))
    return np.stack([x, y, np.cross(x, y)], axis=1)


def smallest_rotation(origin: Array, goal: Array) -> Array:
    """The rotation (3, 3) by the smallest angle that takes one direction to another."""
    u, v = direction(origin), direction(goal)
    c, (x, y, z) = u @ v, np.cross(u, v)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: Array = np.eye(3) + K + K @ K / (1 + c)
    return R


def t_pose_rotations(joints: Array, knuckles: Array) -> Array:
    """World rotations (24, 3, 3) from the A-pose to the T-pose, right as the mirror of left.

    Legs straight down, arms straight along x, the elbow's axis vertical, so that it bends
    forwards, palms down and index finger forward; the trunk, head and feet stay.
    `joints` (24, 3) m; `knuckles` (3, 3) m of the left index, middle and little finger.
    """
    at = {name: joints[k] for name, k in JOINT.items()}
    upper, fore = (
        at["left_elbow"] - at["left_shoulder"],
        at["left_wrist"] - at["left_elbow"],
    )
    index, middle, little = knuckles
    shoulder = frame(X, FRONT) @ frame(upper, fore).T
    hand = frame(X, FRONT) @ frame(middle - at["left_wrist"], index - little).T
    left = {
        "left_hip": smallest_rotation(at["left_knee"] - at["left_hip"], THIGH),
        "left_knee": smallest_rotation(at["left_ankle"] - at["left_knee"], DOWN),
        "left_shoulder": shoulder,
        "left_elbow": smallest_rotation(shoulder @ fore, X) @ shoulder,
        "left_wrist": hand,
        "left_hand": hand,
    }
    rotations = np.tile(np.eye(3), (N_JOINTS, 1, 1))
    for name, R in left.items():
        rotations[JOINT[name]] = R
        rotations[JOINT[name.replace("left", "right")]] = R * np.outer(REFLECTION, REFLECTION)
    return rotations


def to_t_pose(vertices: Array, joints: Array, knuckles: Array, weights: Array) -> RestPose:
    """The rest surface that linear blend skinning takes back to `vertices` (N, 3) exactly.

    `joints` (24, 3) m of the A-pose, `knuckles` as above, `weights` (N, 24).
    """
    R = t_pose_rotations(joints, knuckles)
    rest = joint_positions(R, joints)
    rest -= rest[0]
    back = R.transpose(0, 2, 1)
    shifts = offsets(back, joints, rest)
    return RestPose(unskin(vertices, weights, back, shifts), rest, R)
