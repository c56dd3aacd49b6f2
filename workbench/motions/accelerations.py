"""Velocities and accelerations of a body in motion, seen from its own parts."""

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
