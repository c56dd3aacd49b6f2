"""A flat right hand at rest, palm down, fingers along -x, index finger to the front (+z)."""

import numpy as np

from builder.hands.anatomy import PARENTS
from builder.population import FRONT, RestPose, X, direction, frame, smallest_rotation, unskin
from workbench.arrays import Array
from workbench.synthetic.teacher import joint_positions, offsets

INDEX, MIDDLE, PINKY, RING, THUMB = 1, 4, 7, 10, 13  # the first joint of each finger


def flat_rotations(joints: Array, ends: Array) -> Array:
    """World rotations (16, 3, 3) that flatten a hand: four fingers straight, in the palm's plane.

    `joints` (16, 3) m, `ends` (5, 3) m of index, middle, pinky, ring and thumb. The thumb stays as
    it is on the palm. Each other finger stays in the plane above the direction of its first bone.
    """
    palm = frame(X, FRONT) @ frame(joints[0] - joints[MIDDLE], joints[INDEX] - joints[PINKY]).T
    R = np.tile(palm, (len(joints), 1, 1))
    for finger, first in enumerate((INDEX, MIDDLE, PINKY, RING)):
        chain = [*joints[first : first + 3], ends[finger]]
        goal = direction((palm @ (chain[1] - chain[0])) * [1.0, 0.0, 1.0])
        turned = palm
        for i, k in enumerate(range(first, first + 3)):
            turned = smallest_rotation(turned @ (chain[i + 1] - chain[i]), goal) @ turned
            R[k] = turned
    return R


def to_flat(vertices: Array, joints: Array, ends: Array, weights: Array) -> tuple[RestPose, Array]:
    """The rest surface that linear blend skinning takes back to `vertices` (N, 3), and ends (5, 3).

    The wrist joint is the origin. `weights` (N, 16).
    """
    R = flat_rotations(joints, ends)
    rest = joint_positions(R, joints, PARENTS)
    rest -= rest[0]
    back = R.transpose(0, 2, 1)
    flat = unskin(vertices, weights, back, offsets(back, joints, rest))
    last = np.arange(3, 16, 3)
    moved = rest[last] + (R[last] @ (ends - joints[last])[..., None])[..., 0]
    return RestPose(flat, rest, R), moved
