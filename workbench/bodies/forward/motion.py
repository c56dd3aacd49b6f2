"""The kinematics of a body and their derivatives, whatever the number of vertices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks.functions import Batched, Buffered, Mapped
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
    """The motion of the joints at one pose and shape, or at several; K joints, B betas.

    Attributes:
        G: (..., K, 3, 4) the motion of each joint, which takes what is at rest to where it is.
        features: (..., 9 (K - 1)) what the pose blend shapes are multiplied with.
        joints: (..., K, 3) m, the posed joints.
        column: features, G and joints as one array, of which they are parts, if they are.
    """

    G: Array
    features: Array
    joints: Array
    column: Array | None = None

    def __getitem__(self, which: int | slice) -> Motion:
        """One or some of several motions."""
        return Motion(*_some(self, which))


@dataclass(frozen=True, eq=False)
class Slopes:
    """How a motion changes with pose and betas.

    Attributes:
        turns: (..., K, 9, 3) with rows (a, d), the map u -> (axis of pose[k, a] x u)_d.
        d_features: (..., K - 1, 3, 9) the features of joint k + 1 by its own three numbers.
        d_shift: (..., 3 B, K) with rows (b, d), the last column of G_k by betas[b].
        column: these numbers in the order of `vertex.slopes_column`, if they are known in it.
    """

    turns: Array
    d_features: Array
    d_shift: Array
    column: Array | None = None

    def __getitem__(self, which: int | slice) -> Slopes:
        """The derivatives of one or some of several motions."""
        return Slopes(*_some(self, which))


def _some(of: Motion | Slopes, which: int | slice) -> Iterator[Any]:
    return (None if part is None else part[which] for part in vars(of).values())


class JointNumbers(Protocol):
    """The motion of a body's joints and its derivative, at one pose and shape or at several."""

    def motion(self, pose: Array, betas: Array) -> Motion:
        """How the joints have moved at pose (K, 3) rad and betas (B,)."""

    def slopes(self, pose: Array, betas: Array) -> Slopes:
        """The derivatives of that motion by the pose and by betas."""

    def motion_and_slopes(self, pose: Array, betas: Array) -> tuple[Motion, Slopes]:
        """Both of them, in less time than apart."""

    def motions(self, poses: Array, betas: Array) -> Motion:
        """The motions at poses (M, K, 3) rad and betas (M, B), as arrays over all of them."""

    def slopes_batch(self, poses: Array, betas: Array) -> Slopes:
        """The derivatives of the motions at poses (M, K, 3) rad and betas (M, B), as arrays."""


@dataclass(frozen=True, eq=False)
class Posed:
    """The kinematics at one pose (K, 3) rad and betas (B,); what is asked for is found once.

    Where the pose is one of several, it is found for all of them at once, in a few calls.
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
        """The derivative of the motion by pose and betas."""
        if self.among is not None:
            return self.among.slopes[self.place]
        if "motion" in self.__dict__:
            return self.kinematics.slopes(self.pose, self.betas)
        motion, slopes = self.kinematics.motion_and_slopes(self.pose, self.betas)
        self.__dict__.setdefault("motion", motion)  # as if it had been asked for
        return slopes


@dataclass(frozen=True, eq=False)
class Together:
    """The kinematics at poses (M, K, 3) rad and betas (M, B), found for all when asked for one."""

    kinematics: Kinematics
    poses: Array
    betas: Array

    @cached_property
    def motions(self) -> Motion:
        """The motions of all poses."""
        return self.kinematics.motions(self.poses, self.betas)

    @cached_property
    def slopes(self) -> Slopes:
        """The derivatives of all motions."""
        return self.kinematics.slopes_batch(self.poses, self.betas)


class _Functions(NamedTuple):
    """CasADi functions of pose and betas, and the adjoint of the first."""

    motion: Buffered
    slopes: Buffered
    back: Buffered


class Kinematics:
    """A body's joints, motions and features as functions of pose and betas; their adjoints.

    `compiled`, if it is given, computes all but the adjoints; CasADi computes these, and the
    others too without it.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        bind_pose: Array,
        parents: Sequence[int],
        compiled: JointNumbers | None = None,
    ) -> None:
        K, _, B = skeleton.slopes.shape
        self._sizes, self.skeleton, self.ancestors = (K, B), skeleton, ancestors(parents)
        self._bind_pose, self._parents, self._compiled = bind_pose, tuple(parents), compiled
        self._last: tuple[tuple[bytes, bytes], Posed] | None = None

    @cached_property
    def _functions(self) -> _Functions:
        (K, B), parents = self._sizes, self._parents
        pose, betas = cs.SX.sym("pose", 3, K), cs.SX.sym("betas", B)
        rest = self.skeleton.joints(betas)
        R, R_bind = rodrigues(pose), rodrigues(cs.SX(cs.DM(self._bind_pose.T)))
        G, joints = binding_motions(R, R_bind, rest, parents)
        features = pose_features(R, R_bind)
        world = world_motions(R, bones_of(rest, R_bind, parents), parents)
        by_angle = local_slopes(pose, R)
        above = [cs.SX.eye(3), *(world[parent][0] for parent in parents[1:])]
        axes = turning_axes(by_angle, R, above)
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
        pull_G = cs.SX.sym("pull_G", 3, 4 * K)
        pull_f = cs.SX.sym("pull_f", features.shape[0])
        felt = cs.dot(pull_G, stacked) + cs.dot(pull_f, features)
        back = [cs.densify(cs.gradient(felt, pose)), cs.densify(cs.gradient(felt, betas))]
        of = [pose, betas]
        moving, sloping = (
            Buffered(cs.Function("kinematics", of, [cs.densify(part) for part in parts]))
            for parts in (outputs, slopes)
        )
        adjoint = cs.Function("adjoint", [*of, pull_G, pull_f], back)
        return _Functions(moving, sloping, Buffered(adjoint))

    def evaluate(self, pose: Array, betas: Array) -> Posed:
        """The kinematics at pose (K, 3) rad and betas (B,), computed when they are asked for.

        Those of the last pose are kept, for several sources of points may ask for the same one.
        """
        last, key = self._last, (pose.tobytes(), betas.tobytes())
        if last is None or key != last[0]:
            last = key, Posed(self, np.array(pose), np.array(betas))  # copies: it is lazy
            self._last = last  # once: a thread may replace it
        return last[1]

    def evaluate_each(self, poses: Array, betas: Array) -> list[Posed]:
        """The kinematics at each of the poses (M, K, 3) rad with its betas (M, B)."""
        among = Together(self, poses, betas)
        return [Posed(self, poses[i], betas[i], among, i) for i in range(len(poses))]

    def motion(self, pose: Array, betas: Array) -> Motion:
        """The motion at pose (K, 3) rad and betas (B,)."""
        if self._compiled is not None:
            return self._compiled.motion(pose, betas)
        return self._shaped(self._functions.motion(pose, betas))

    def motions(self, poses: Array, betas: Array) -> Motion:
        """The motions at poses (M, K, 3) rad and betas (M, B), as arrays over all of them."""
        if self._compiled is not None:
            return self._compiled.motions(poses, betas)
        return self._shaped(self._motions(poses.reshape(len(poses), 3 * self._sizes[0]), betas))

    def slopes(self, pose: Array, betas: Array) -> Slopes:
        """The derivatives of the motion at pose (K, 3) rad and betas (B,)."""
        if self._compiled is not None:
            return self._compiled.slopes(pose, betas)
        return self._shaped_slopes(self._functions.slopes(pose, betas))

    def motion_and_slopes(self, pose: Array, betas: Array) -> tuple[Motion, Slopes]:
        """Both of them at pose (K, 3) rad and betas (B,)."""
        if self._compiled is not None:
            return self._compiled.motion_and_slopes(pose, betas)
        return self.motion(pose, betas), self.slopes(pose, betas)

    def slopes_batch(self, poses: Array, betas: Array) -> Slopes:
        """The derivatives of the motions at poses (M, K, 3) rad and betas (M, B), as arrays."""
        if self._compiled is not None:
            return self._compiled.slopes_batch(poses, betas)
        return self._shaped_slopes(
            self._slopes_batch(poses.reshape(len(poses), 3 * self._sizes[0]), betas)
        )

    @cached_property
    def _motions(self) -> Batched:
        return Mapped(self._functions.motion.function, (False, False))

    @cached_property
    def _slopes_batch(self) -> Batched:
        return Mapped(self._functions.slopes.function, (False, False))

    def _shaped(self, outputs: Sequence[Array]) -> Motion:
        (K, _), (G, features, joints) = self._sizes, outputs
        some = features.shape[:-1]
        return Motion(
            G.reshape(*some, K, 3, 4),
            features,
            joints.reshape(*some, K, 3),
        )

    def _shaped_slopes(self, outputs: Sequence[Array]) -> Slopes:
        (K, B), (turns, d_features, steps) = self._sizes, outputs
        some = steps.shape[:-1]
        # Joint k is where G_k and its parent's G agree, so the last column of G_k is that of its
        # parent plus (R_parent - R_k) J_k, and J_k is linear in betas.
        own = steps.reshape(*some, K, 3, 3) @ self.skeleton.slopes  # (..., K, 3, B)
        return Slopes(
            turns.reshape(*some, K, 9, 3),
            d_features.reshape(*some, max(0, K - 1), 3, 9),
            own.swapaxes(-1, -3).reshape(*some, 3 * B, K) @ self.ancestors.T,
        )

    def vjp(
        self, pose: Array, betas: Array, on_G: Array, on_features: Array
    ) -> tuple[Array, Array]:
        """The gradients (K, 3) and (B,) of sum(on_G * G) + on_features . f, on_G (K, 3, 4)."""
        on_pose, on_betas = self._functions.back(pose, betas, on_G.transpose(0, 2, 1), on_features)
        return on_pose.reshape(pose.shape), on_betas
