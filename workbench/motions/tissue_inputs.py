"""What drives soft tissue: velocities and accelerations of joints, of the root, of soft parts."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.posing import Posing
from workbench.errors import BadArgument
from workbench.geometry.rotation import vector_from_matrix
from workbench.motions.motion import Motion

GRAVITY = np.array([0.0, -9.81, 0.0])  # m/s^2


@dataclass(frozen=True, eq=False)
class MovingFrames:
    """The frames of a body's joints along a motion, whose joints are those of the body.

    Attributes:
        body: the body.
        motion: the motion, under the names of the body's joints.
    """

    body: SkinnedBody
    motion: Motion

    @staticmethod
    def of(body: SkinnedBody, motion: Motion) -> "MovingFrames":
        """Of a motion, named as the body (`Motion.named`). Raises BadArgument for few frames."""
        if len(motion) < 3:
            raise BadArgument(
                f"an acceleration needs three frames or more, and this motion has {len(motion)}"
            )
        return MovingFrames(body, motion.named(body))

    @cached_property
    def turns(self) -> Array:
        """How each joint has turned the skin that follows it, (T, K, 3, 3)."""
        body = self.body
        bound = Posing.of(body.bind_pose[None], body.parents).world[0]
        world = Posing.of(self.motion.pose, body.parents).world
        return np.asarray(world @ bound.swapaxes(-1, -2))

    @cached_property
    def joints(self) -> Array:
        """The posed joints, (T, K, 3) m."""
        return self.motion.joints(self.body)

    @cached_property
    def angular_velocities(self) -> Array:
        """Of each joint relative to its parent, in its own frame, (T, K, 3) rad/s.

        They are the logarithms of R_(t-1)' R_(t+1) over two frames, and do not see that a rotation
        vector may jump by a full turn.
        """
        local = Posing.of(self.motion.pose, self.body.parents).local
        way = vector_from_matrix(local[:-2].swapaxes(-1, -2) @ local[2:])
        return _same_at_ends(way * (self.motion.fps / 2))

    @cached_property
    def world_turning(self) -> Array:
        """The angular velocity of each joint's frame, in the world, (T, K, 3) rad/s."""
        R = self.turns
        way = vector_from_matrix(R[2:] @ R[:-2].swapaxes(-1, -2))
        return _same_at_ends(way * (self.motion.fps / 2))

    def forces(self, points: Array, joints: Index) -> Array:
        """What points (P, 3) m at rest feel that are fixed to joints (P,): (T, P, 3) m/s^2.

        In the frame of its joint, a point of mass one is pulled by R'(g - a), with gravity g and
        the acceleration a of its place. What it feels in the rest pose, g, is subtracted, because
        the body at rest has the form that gravity gives it.
        """
        R, at_rest = self.turns[:, joints], self.body.joints(None, self.motion.betas)
        arms = points - at_rest[joints]
        places = np.einsum("tpij,pj->tpi", R, arms) + self.joints[:, joints]
        pull = GRAVITY - second_differences(places, self.motion.fps)
        return np.asarray(np.einsum("tpji,tpj->tpi", R, pull) - GRAVITY)


def first_differences(values: Array, fps: float) -> Array:
    """The central differences (T, ...) a second; at the ends those next to them."""
    return _same_at_ends((values[2:] - values[:-2]) * (fps / 2))


def second_differences(values: Array, fps: float) -> Array:
    """The second differences (T, ...) a second squared; at the ends those next to them."""
    return _same_at_ends((values[2:] - 2 * values[1:-1] + values[:-2]) * fps**2)


def _same_at_ends(inner: Array) -> Array:
    return np.concatenate([inner[:1], inner, inner[-1:]])


FASTEST_TURN, FASTEST_CHANGE = 8.0, 80.0  # rad/s, rad/s^2
FASTEST_ROOT, HARDEST_PUSH = 4.0, 25.0  # m/s, m/s^2
STRONGEST_FORCE = 20.0  # m/s^2: about two more gravities


def tissue_inputs(frames: MovingFrames, part: Index, n_betas: int = 0) -> Array:
    """The inputs (T, X) along a motion, in this order:

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
    return np.hstack(parts)


def _bounded(vectors: Array, most: float) -> Array:
    """Vectors (T, V, 3) as shares of `most`, smoothly kept shorter than 1, as rows (T, 3 V)."""
    square = (vectors**2).sum(axis=-1, keepdims=True)
    shares = vectors / np.sqrt(most**2 + square)
    return np.asarray(shares.reshape(len(vectors), -1))


def part_middles(body: SkinnedBody, part: Index, betas: Array) -> tuple[Array, Index]:
    """The middle of each soft part at rest, (P, 3) m, and the joint that moves most of it, (P,)."""
    surface = body.vertices(body.bind_pose, betas)
    of = [np.flatnonzero(part == p) for p in range(int(part.max(initial=-1)) + 1)]
    middles = np.array([surface[some].mean(axis=0) for some in of]).reshape(-1, 3)
    joints = [int(body.weights[some].sum(axis=0).argmax()) for some in of]
    return middles, np.array(joints, dtype=np.int64)
