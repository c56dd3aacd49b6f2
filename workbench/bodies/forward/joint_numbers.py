"""Posed joints in numbers, from what the kinematics say, however many vertices there are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.many_joints import ManyJoints
from workbench.bodies.forward.motion import Kinematics, Posed, Slopes


@dataclass(frozen=True, eq=False)
class NumericJoints:
    """The posed joints of a body by arithmetic; see BodyPoints.

    With t_k = G'_k (j_k; 1) the posed joint k, and w_ka the axis about which the world turns when
    pose[k, a] grows,

        dt_j/dpose[k, a] = w_ka x (t_j - t_k) for every j below k, and zero for all others.
    """

    kinematics: Kinematics
    at_origin: ManyJoints  # many at once, before translation
    parents: tuple[int, ...]

    @cached_property
    def ancestors(self) -> Array:
        """(K, K); see `kinematics.ancestors`."""
        return ancestors(self.parents)

    def at(self, pose: Array, betas: Array, trans: Array) -> JointsAt:
        """The joints at one pose, betas and translation."""
        return JointsAt(self, self.kinematics.at(pose, betas), trans)

    def each(self, poses: Array, betas: Array, trans: Array) -> list[JointsAt]:
        """The joints at M poses, betas and translations, which share their kinematics."""
        posed = self.kinematics.each(poses, betas)
        return [JointsAt(self, one, t) for one, t in zip(posed, trans, strict=True)]

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, K, 3) m, generation by generation."""
        return self.at_origin(pose, betas) + trans[:, None]


@dataclass(frozen=True, eq=False)
class JointsAt:
    """The joints at one pose (K, 3) rad, betas (B,) and trans (3,) m; see PointsAt."""

    of: NumericJoints
    posed: Posed
    trans: Array

    @cached_property
    def points(self) -> Array:
        """The posed joints, (K, 3) m."""
        return self.posed.motion.joints + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[name] (size, 3 K)."""
        slopes = self.posed.slopes
        made = {"pose": self._by_pose, "betas": self._by_betas, "trans": self._by_trans}
        for name, array in into.items():
            found = made[name](slopes)
            np.multiply(found, 1.0 if scale is None else scale, out=array)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        kinematics, pulled = self.of.kinematics, pull.reshape(-1, 3)
        skeleton = kinematics.skeleton
        rest = np.ones((len(pulled), 4))
        rest[:, :3] = skeleton.at(self.posed.betas)
        on_G = pulled[:, :, None] * rest[:, None]
        none = np.zeros_like(self.posed.motion.features)
        on_pose, through_G = self.posed.adjoint(on_G, none)
        on_rest = np.matmul(pulled[:, None], self.posed.motion.G[:, :, :3]).ravel()
        on_betas = on_rest @ skeleton.slopes.reshape(len(on_rest), len(self.posed.betas))
        return {
            "pose": on_pose.ravel(),
            "betas": on_betas + through_G,
            "trans": pulled.sum(axis=0),
        }

    def _by_pose(self, slopes: Slopes) -> Array:
        """(3 K, 3 K), a row for each number of the pose."""
        t, K = self.posed.motion.joints, len(self.posed.pose)
        arms = t.T - t[:, :, None]  # (K, 3, K): from joint k to joint j
        arms *= self.of.ancestors.T[:, None]
        found: Array = np.matmul(slopes.turns, arms).reshape(K, 3, 3, K)
        return found.transpose(0, 1, 3, 2).reshape(3 * K, 3 * K)

    def _by_betas(self, slopes: Slopes) -> Array:
        """The transposed derivative of the joints by betas, (B, 3 K)."""
        K, B = len(self.posed.pose), len(self.posed.betas)
        at_rest = self.posed.motion.G[:, :, :3] @ self.of.kinematics.skeleton.slopes  # (K, 3, B)
        moved: Array = at_rest.transpose(2, 1, 0) + slopes.d_shift.reshape(B, 3, K)
        return moved.transpose(0, 2, 1).reshape(B, 3 * K)

    def _by_trans(self, _: Slopes) -> Array:
        """The transposed derivative of the joints by trans, (3, 3 K)."""
        return np.tile(np.eye(3), len(self.posed.pose))
