"""The kinematics of a body in numbers, whatever the number of vertices; for one pose or many.

Joint k turns by the rotation vector theta_k = t n in the frame of its parent up(k), whose G stands
for the identity above the root:

    R_k = exp([theta_k]x) = cos(t) I + sin(t) [n]x + (1 - cos(t)) n n'
    world_k = world_up [R_k, bone_k],      G_k = world_k bound_k^-1 = [turn_k, t_k - turn_k J_k]

With the left Jacobian L_k = sin(t)/t I + (1 - cos(t))/t [n]x + (1 - sin(t)/t) n n', for which
exp([theta + d]x) = exp([L d]x) exp([theta]x) to first order, everything at and below joint k turns
about the axis w_ka = R_up L_k e_a through the posed joint t_k when pose[k, a] grows:

    dG_j/dpose[k, a] = [w_ka]x (G_j - [0, t_k])   for every j at or below k, zero for all others
    dR_k/dpose[k, a] = [L_k e_a]x R_k             of which pose features are made

Joint k is where G_k and G_up agree, so that betas, in which the joints J are linear, shift G_k by
as much as G_up, and by (turn_up - turn_k) dJ_k.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.kinematics import Skeleton, ancestors
from workbench.bodies.forward.posing import axial, world_rotations
from workbench.geometry.rotation import crossed, left_jacobian, matrix_from_vector

if TYPE_CHECKING:
    from workbench.bodies.forward.compiled import CompiledJoints
    from workbench.bodies.forward.named_points import RowTarget


@dataclass(frozen=True, eq=False)
class JointMotion:
    """How K joints have moved at a pose (..., K, 3) rad: one, or several.

    `numbers` (..., 24 K - 9) hold features, G and joints, in this order.
    """

    kinematics: Kinematics
    pose: Array
    numbers: Array

    @cached_property
    def features(self) -> Array:
        """What pose blend shapes are multiplied with, (..., 9 (K - 1))."""
        return self.numbers[..., : 9 * (self.pose.shape[-2] - 1)]

    @cached_property
    def G(self) -> Array:
        """What takes what is at rest to where it is, for each joint, (..., K, 3, 4)."""
        K = self.pose.shape[-2]
        return self.numbers[..., 9 * (K - 1) : -3 * K].reshape(*self.pose.shape[:-1], 3, 4)

    @cached_property
    def joints(self) -> Array:
        """The posed joints, (..., K, 3) m."""
        return self.numbers[..., -3 * self.pose.shape[-2] :].reshape(self.pose.shape)

    @cached_property
    def derivatives(self) -> MotionDerivatives:
        """How the motion changes with pose and betas."""
        return self.kinematics.derivatives(self)

    def each(self) -> list[JointMotion]:
        """The M motions of poses (M, K, 3), one by one."""
        apart = zip(self.pose, self.numbers, strict=True)
        return [JointMotion(self.kinematics, *parts) for parts in apart]

    def __getitem__(self, some: slice) -> JointMotion:
        """Some of several motions."""
        return JointMotion(self.kinematics, self.pose[some], self.numbers[some])

    def vjp(self, on_G: Array, on_features: Array) -> tuple[Array, Array]:
        """Gradients (K, 3) and (B,) of sum(on_G * G) + on_features . f, by pose and betas."""
        by, below = self.derivatives, self.kinematics.ancestors.T
        # all that is at and below a joint turns about where the joint is
        torque, force = below @ axial(on_G, self.G), below @ on_G[:, :, 3]
        torque -= (crossed(self.joints) @ force[:, :, None])[:, :, 0]
        on_pose = np.einsum("kad,kd->ka", by.axes, torque)
        on_pose[1:] += np.einsum("kna,kn->ka", by.d_features[1:], on_features.reshape(-1, 9))
        return on_pose, np.einsum("bkd,kd->b", by.d_shift, on_G[:, :, 3])


@dataclass(frozen=True, eq=False)
class MotionDerivatives:
    """How a motion, or several, changes with pose and betas, of which `sizes` are K and B.

    `numbers` (..., 36 K + 3 B K) hold axes, d_features and d_shift, in this order.
    """

    sizes: tuple[int, int]
    numbers: Array

    @cached_property
    def axes(self) -> Array:
        """w: the axis about which the world turns by each number of the pose, (..., K, 3, 3)."""
        K, _ = self.sizes
        return self.numbers[..., : 9 * K].reshape(*self.numbers.shape[:-1], K, 3, 3)

    @cached_property
    def d_features(self) -> Array:
        """The nine features of each joint by its three numbers, (..., K, 9, 3): root zero."""
        K, _ = self.sizes
        return self.numbers[..., 9 * K : 36 * K].reshape(*self.numbers.shape[:-1], K, 9, 3)

    @cached_property
    def d_shift(self) -> Array:
        """The last column of each G by betas, (..., B, K, 3)."""
        K, B = self.sizes
        return self.numbers[..., 36 * K :].reshape(*self.numbers.shape[:-1], B, K, 3)

    @cached_property
    def turns(self) -> Array:
        """The maps u -> w_ka x u in rows (a, d), (..., K, 9, 3)."""
        return crossed(self.axes).reshape(*self.axes.shape[:-2], 9, 3)


class PointsAtMotion(ABC):
    """Points of a body at one motion and shape, before translation."""

    @property
    @abstractmethod
    def points(self) -> Array:
        """The posed points, (N, 3) m."""

    @abstractmethod
    def write_jacobian(
        self, by: MotionDerivatives, into: Mapping[str, RowTarget], scale: Array | None
    ) -> None:
        """Write the transposed derivative into `pose` (3 K, 3 N), `betas`, `trans` and `offsets`.

        Each column is multiplied by its scale (3 N,), if there is one. `into` holds zeros wherever
        the derivative is always zero.
        """

    @abstractmethod
    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """Gradients of cotangent (N, 3) . points by G (K, 3, 4), features and betas."""

    def vjp_of_offsets(self, cotangent: Array) -> Array:
        """The gradient of cotangent (N, 3) . points by offsets (N, 3), where points have these."""
        raise NotImplementedError("these points have no offsets")


class Kinematics:
    """A body's joints, motions and features as functions of pose and betas.

    `compiled`, if it is given, computes them in place of NumPy. `bind` (K, 3, 3) are the rotations
    of the joints in the bind pose, in their parents' frames, and `bound` the same in the world.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        bind_pose: Array,
        parents: Sequence[int],
        compiled: CompiledJoints | None = None,
    ) -> None:
        K, _, B = skeleton.by_betas.shape
        self.skeleton, self.parents, self._compiled = skeleton, tuple(parents), compiled
        self.ancestors = ancestors(parents)
        self.bind = matrix_from_vector(bind_pose)
        self.bound = world_rotations(self.bind, parents)
        self._up = np.maximum(parents, 0)  # the root's is not used
        self._bound_above = np.concatenate([np.eye(3)[None], self.bound[self._up[1:]]])
        places = np.concatenate([skeleton.mean[:, :, None], skeleton.by_betas], axis=2)
        bones = places.copy()  # each joint in its parent's frame, as an affine function of betas
        bones[1:] = self._bound_above[1:].swapaxes(1, 2) @ (places[1:] - places[self._up[1:]])
        self._rest = np.concatenate([places, bones]).reshape(6 * K, 1 + B).T.copy()
        up = np.append(np.array(self.parents) % (K + 1), K)  # K: the world, which is its own parent
        self._jumps = []  # to the ancestor 1, 2, 4 and so on generations above
        while (up < K).any():
            self._jumps.append(up)
            up = up[up]
        self._last: tuple[tuple[bytes, bytes], JointMotion] | None = None

    def motion_kept(self, pose: Array, betas: Array) -> JointMotion:
        """The motion at pose (K, 3) rad and betas (B,); that of the last pose is kept.

        Several sources of points may ask for the same one.
        """
        last, key = self._last, (pose.tobytes(), betas.tobytes())
        if last is None or key != last[0]:
            last = key, self.motion(pose, betas)
            self._last = last  # once: a thread may replace it
        return last[1]

    def motion(self, pose: Array, betas: Array) -> JointMotion:
        """The motion at pose (..., K, 3) rad and betas (..., B).

        Raises ValueError for arrays of other sizes.
        """
        K, _, B = self.skeleton.by_betas.shape
        batch = betas.shape[:-1]
        if betas.shape[-1] != B:
            raise ValueError(f"there are {B} betas, not {betas.shape[-1]}")
        theta = np.array(pose, dtype=np.float64, order="C").reshape(*batch, K, 3)  # kept
        motion = JointMotion(self, theta, np.empty((*batch, 24 * K - 9)))
        if self._compiled is not None:
            self._compiled.motion(motion, betas)
        else:
            self._move(motion, betas)
        return motion

    def derivatives(self, motion: JointMotion) -> MotionDerivatives:
        """The derivatives of a motion, or of several."""
        K, _, B = self.skeleton.by_betas.shape
        by = MotionDerivatives((K, B), np.empty((*motion.pose.shape[:-2], (36 + 3 * B) * K)))
        if self._compiled is not None:
            self._compiled.derivatives(motion, by)
        else:
            self._derive(motion, by)
        return by

    def _move(self, motion: JointMotion, betas: Array) -> None:
        K, batch = len(self.parents), betas.shape[:-1]
        R = matrix_from_vector(motion.pose)
        rest = (self._rest[0] + betas @ self._rest[1:]).reshape(*batch, 2, K, 3)
        world = np.zeros((*batch, K + 1, 4, 4))
        world[..., :K, :3, :3], world[..., :K, :3, 3] = R, rest[..., 1, :, :]
        world[..., 3, 3], world[..., K, :3, :3] = 1, np.eye(3)
        for up in self._jumps:  # each motion is from 1, 2, 4 and so on generations above
            world = world.take(up, axis=-3) @ world
        world = world[..., :K, :3, :]
        motion.features[...] = (R - self.bind)[..., 1:, :, :].reshape(*batch, 9 * (K - 1))
        motion.joints[...] = world[..., 3]
        turn = np.matmul(world[..., :3], self.bound.swapaxes(1, 2), out=motion.G[..., :3])
        motion.G[..., 3] = motion.joints - (turn @ rest[..., 0, :, :, None])[..., 0]

    def _derive(self, motion: JointMotion, by: MotionDerivatives) -> None:
        (K, _, B), batch = self.skeleton.by_betas.shape, motion.pose.shape[:-2]
        turn = motion.G[..., :3]
        above = turn[..., self._up, :, :]
        above[..., 0, :, :] = np.eye(3)
        L = left_jacobian(motion.pose)
        by.axes[...] = (above @ self._bound_above @ L).swapaxes(-1, -2)
        R = motion.features.reshape(*batch, K - 1, 1, 3, 3) + self.bind[1:, None]
        turned = crossed(L[..., 1:, :, :].swapaxes(-1, -2)) @ R  # (..., K - 1, a, 3, 3)
        by.d_features[..., 0, :, :] = 0
        by.d_features[..., 1:, :, :] = turned.reshape(*batch, K - 1, 3, 9).swapaxes(-1, -2)
        changes = ((above - turn) @ self.skeleton.by_betas).reshape(*batch, K, 3 * B)
        shift = (self.ancestors @ changes).reshape(*batch, K, 3, B)
        by.d_shift[...] = shift.swapaxes(-1, -3).swapaxes(-1, -2)
