"""The half of a body that does not know how many vertices there are: its kinematics, derived."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs

from workbench.arrays import Array
from workbench.blocks.batched import Batched, Mapped
from workbench.blocks.buffered import Buffered
from workbench.bodies.forward.kinematics import (
    ancestors,
    binding_motions,
    bones_of,
    local_slopes,
    pose_features,
    turning_axes,
    world_motions,
)
from workbench.bodies.forward.skeleton import Skeleton
from workbench.geometry.rotation import rodrigues


@dataclass(frozen=True, eq=False)
class Motion:
    """What the kinematics say at one pose and shape; K joints, B betas."""

    G: Array  # (K, 3, 4): rest to posed
    features: Array  # (9 (K - 1),)
    joints: Array  # (K, 3) m, posed


@dataclass(frozen=True, eq=False)
class Slopes:
    """How a motion changes with pose and betas."""

    turns: Array  # (K, 9, 3): rows (a, d), u -> (axis of pose[k, a] x u)_d
    d_features: Array  # (K - 1, 3, 9): joint k + 1's features by its own three numbers
    d_shift: Array  # (3 B, K): rows (b, d), the last column of G_k by betas[b]


@dataclass(frozen=True, eq=False)
class Posed:
    """The kinematics at one pose (K, 3) rad and betas (B,); what is asked for is found once.

    Where the pose is one of many, it is found for all of them at once, in a few calls.
    """

    kinematics: Kinematics
    pose: Array
    betas: Array
    among: Together | None = None
    place: int = 0

    @cached_property
    def motion(self) -> Motion:
        """The motion of the joints."""
        if self.among is not None:
            return self.among.motions[self.place]
        return self.kinematics.motion(self.pose, self.betas)

    @cached_property
    def slopes(self) -> Slopes:
        """The derivative of the motion."""
        if self.among is not None:
            return self.among.slopes[self.place]
        return self.kinematics.slopes(self.pose, self.betas)

    def adjoint(self, on_G: Array, on_features: Array) -> tuple[Array, Array]:
        """See Kinematics."""
        return self.kinematics.adjoint(self.pose, self.betas, on_G, on_features)


@dataclass(frozen=True, eq=False)
class Together:
    """The kinematics at poses (M, K, 3) rad and betas (M, B), found for all when asked for one."""

    kinematics: Kinematics
    poses: Array
    betas: Array

    @cached_property
    def motions(self) -> list[Motion]:
        """The motion of each pose."""
        return self.kinematics.many_motions(self.poses, self.betas)

    @cached_property
    def slopes(self) -> list[Slopes]:
        """The derivative of the motion of each pose."""
        return self.kinematics.many_slopes(self.poses, self.betas)


class Kinematics:
    """A body's joints, motions and features as CasADi functions of pose and betas, and back."""

    def __init__(self, skeleton: Skeleton, bind_pose: Array, parents: Sequence[int]) -> None:
        K, _, B = skeleton.slopes.shape
        self._sizes, self.skeleton, self._ancestors = (K, B), skeleton, ancestors(parents)
        pose, betas = cs.SX.sym("pose", 3, K), cs.SX.sym("betas", B)
        rest = skeleton.joints(betas)
        R, R_bind = rodrigues(pose), rodrigues(cs.SX(cs.DM(bind_pose.T)))
        G, joints = binding_motions(R, R_bind, rest, parents)
        features = pose_features(R, R_bind)
        world = world_motions(R, bones_of(rest, R_bind, parents), parents)
        by_angle = local_slopes(pose, R)
        axes = turning_axes(by_angle, R, [R_k for R_k, _ in world], parents)
        d_features = [cs.vec(D.T) for own in by_angle[1:] for D in own]
        stacked = cs.horzcat(*G)  # (3, 4 K)
        turns = [cs.SX.eye(3), *(motion[:, :3] for motion in G)]
        steps = [turns[parent + 1] - turn for parent, turn in zip(parents, turns[1:], strict=True)]
        outputs = [cs.vertcat(*[cs.vec(motion.T) for motion in G]), features, joints]
        slopes = [
            cs.vertcat(*[cs.vec(cs.skew(axis).T) for axis in axes]),
            cs.vertcat(*d_features) if d_features else cs.SX(0, 1),
            cs.vertcat(*[cs.vec(step.T) for step in steps]),
        ]
        self._motion, self._slopes = (
            Buffered(cs.Function("kinematics", [pose, betas], [cs.densify(part) for part in parts]))
            for parts in (outputs, slopes)
        )
        pull_G = cs.SX.sym("pull_G", 3, 4 * K)
        pull_f = cs.SX.sym("pull_f", features.shape[0])
        felt = cs.dot(pull_G, stacked) + cs.dot(pull_f, features)
        back = [cs.densify(cs.gradient(felt, pose)), cs.densify(cs.gradient(felt, betas))]
        self._back = Buffered(cs.Function("adjoint", [pose, betas, pull_G, pull_f], back))

    def motion(self, pose: Array, betas: Array) -> Motion:
        """At pose (K, 3) rad and betas (B,)."""
        K, _ = self._sizes
        G, features, joints = self._motion(pose, betas)
        return Motion(G.reshape(K, 3, 4), features, joints.reshape(K, 3))

    def at(self, pose: Array, betas: Array) -> Posed:
        """At pose (K, 3) rad and betas (B,)."""
        return Posed(self, pose, betas)

    def each(self, poses: Array, betas: Array) -> list[Posed]:
        """At poses (M, K, 3) rad and betas (M, B)."""
        among = Together(self, poses, betas)
        return [Posed(self, poses[i], betas[i], among, i) for i in range(len(poses))]

    def many_motions(self, poses: Array, betas: Array) -> list[Motion]:
        """At poses (M, K, 3) rad and betas (M, B)."""
        M, K, _ = poses.shape
        G, features, joints = self._motions(poses.reshape(M, 3 * K), betas)
        G, joints = G.reshape(M, K, 3, 4), joints.reshape(M, K, 3)
        return [Motion(*parts) for parts in zip(G, features, joints, strict=True)]

    def many_slopes(self, poses: Array, betas: Array) -> list[Slopes]:
        """At poses (M, K, 3) rad and betas (M, B)."""
        M, (K, B) = len(poses), self._sizes
        turns, d_features, steps = self._many_slopes(poses.reshape(M, 3 * K), betas)
        own = steps.reshape(M, K, 3, 3) @ self.skeleton.slopes
        shifts = own.transpose(0, 3, 2, 1).reshape(M, 3 * B, K) @ self._ancestors.T
        turns, d_features = turns.reshape(M, K, 9, 3), d_features.reshape(M, max(0, K - 1), 3, 9)
        return [Slopes(*parts) for parts in zip(turns, d_features, shifts, strict=True)]

    def motions(self, pose: Array, betas: Array) -> tuple[Array, Array]:
        """G (M, K, 3, 4) and features (M, F), at poses (M, K, 3) rad and betas (M, B)."""
        K, _ = self._sizes
        G, features, _joints = self._motions(pose.reshape(len(pose), 3 * K), betas)
        return G.reshape(len(pose), K, 3, 4), features

    @cached_property
    def _motions(self) -> Batched:
        return Mapped(self._motion.function, (False, False))

    @cached_property
    def _many_slopes(self) -> Batched:
        return Mapped(self._slopes.function, (False, False))

    def slopes(self, pose: Array, betas: Array) -> Slopes:
        """Of the motion at pose (K, 3) rad and betas (B,)."""
        K, B = self._sizes
        turns, d_features, steps = self._slopes(pose, betas)
        # Joint k is where G_k and its parent's G agree, so the last column of G_k is that of its
        # parent plus (R_parent - R_k) J_k, and J_k is linear in betas.
        own = steps.reshape(K, 3, 3) @ self.skeleton.slopes  # (K, 3, B)
        return Slopes(
            turns.reshape(K, 9, 3),
            d_features.reshape(max(0, K - 1), 3, 9),
            own.transpose(2, 1, 0).reshape(3 * B, K) @ self._ancestors.T,
        )

    def adjoint(
        self, pose: Array, betas: Array, on_G: Array, on_features: Array
    ) -> tuple[Array, Array]:
        """The gradients (K, 3) and (B,) of sum(on_G * G) + on_features . f, on_G (K, 3, 4)."""
        on_pose, on_betas = self._back(pose, betas, on_G.transpose(0, 2, 1), on_features)
        return on_pose.reshape(pose.shape), on_betas
