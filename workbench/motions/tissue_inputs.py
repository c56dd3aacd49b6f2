"""What drives soft tissue: velocities and accelerations of joints, of the root, of soft parts."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.motions.accelerations import MovingFrames, first_differences, second_differences

FASTEST_TURN, FASTEST_CHANGE = 8.0, 80.0  # rad/s, rad/s^2
FASTEST_ROOT, HARDEST_PUSH = 4.0, 25.0  # m/s, m/s^2
STRONGEST_FORCE = 20.0  # m/s^2: about two more gravities


@dataclass(frozen=True, eq=False)
class TissueInputs:
    """The inputs of the model in T frames.

    Attributes:
        values: (T, X).
        names: (X,) what each of them is.
    """

    values: Array
    names: tuple[str, ...]


def tissue_inputs(frames: MovingFrames, part: Index, n_betas: int = 0) -> TissueInputs:
    """The inputs along a motion, in this order:

    - the angular velocity of each joint relative to its parent (rad/s), and its derivative
      (rad/s^2), the root's first;
    - velocity and acceleration of the root, in its own frame (m/s, m/s^2);
    - what the middle of each soft part feels in the frame of its joint (m/s^2): gravity less
      acceleration, less what it feels at rest (`MovingFrames.forces`);
    - the first `n_betas` betas, and 1.

    Each vector v of these is a share of its bound m, the constants above: v / sqrt(m^2 + |v|^2),
    which is about v / m where it is small and never longer than 1. So whatever a motion holds, such
    as a joint that flips between two frames of a recording, the coefficients of a stable model stay
    bounded, and fast motion moves tissue less than in proportion, as tissue stiffens when it is
    stretched.

    All but the forces are those of Dyna (Pons-Moll et al., 2015). The forces are no linear function
    of them: they depend on where down is, and on how far a part is from the joints that turn.
    """
    body, motion = frames.body, frames.motion
    spin = frames.angular_velocities
    T = len(spin)
    R = frames.turns[:, 0].swapaxes(-1, -2)
    root = frames.joints[:, 0]
    moving = (first_differences(root, motion.fps), second_differences(root, motion.fps))
    own = [np.einsum("tij,tj->ti", R, line) for line in moving]
    middles, joints = part_middles(body, part, motion.betas)
    betas = np.zeros(n_betas)
    known = min(n_betas, len(motion.betas))
    betas[:known] = motion.betas[:known]
    parts = [
        _bounded(spin, FASTEST_TURN),
        _bounded(first_differences(spin, motion.fps), FASTEST_CHANGE),
        _bounded(own[0][:, None], FASTEST_ROOT),
        _bounded(own[1][:, None], HARDEST_PUSH),
        _bounded(frames.forces(middles, joints), STRONGEST_FORCE),
        np.tile(betas, (T, 1)),
        np.ones((T, 1)),
    ]
    return TissueInputs(np.hstack(parts), input_names(body.joint_names, len(joints), n_betas))


def _bounded(vectors: Array, most: float) -> Array:
    """Vectors (T, V, 3) as shares of `most`, smoothly kept shorter than 1, as rows (T, 3 V)."""
    square = (vectors**2).sum(axis=-1, keepdims=True)
    shares = vectors / np.sqrt(most**2 + square)
    return np.asarray(shares.reshape(len(vectors), -1))


def input_names(joint_names: tuple[str, ...], n_parts: int, n_betas: int) -> tuple[str, ...]:
    """The names of the inputs, in their order."""
    things = [f"{what} of {k}" for what in ("velocity", "acceleration") for k in joint_names]
    things += ["velocity of the root's place", "acceleration of the root's place"]
    things += [f"force on part {p}" for p in range(n_parts)]
    named = [f"{thing}, {axis}" for thing in things for axis in "xyz"]
    return (*named, *(f"betas[{i}]" for i in range(n_betas)), "1")


def part_middles(body: SkinnedBody, part: Index, betas: Array) -> tuple[Array, Index]:
    """The middle of each soft part at rest, (P, 3) m, and the joint that moves most of it, (P,)."""
    surface = body.vertices(body.bind_pose, betas)
    of = [np.flatnonzero(part == p) for p in range(int(part.max(initial=-1)) + 1)]
    middles = np.array([surface[some].mean(axis=0) for some in of]).reshape(-1, 3)
    joints = [int(body.weights[some].sum(axis=0).argmax()) for some in of]
    return middles, np.array(joints, dtype=np.int64)
