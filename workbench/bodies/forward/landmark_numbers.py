"""Landmarks on a linearly blended body in numbers: a few rest points, each on one joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.motion import Kinematics, Posed, Slopes
from workbench.bodies.forward.rest_points import RestPoints


@dataclass(frozen=True, eq=False)
class NumericLandmarks:
    """Landmarks of an SMPL body whose arrays are all numbers; see BodyPoints.

    The formulas are those of a surface (`numeric`), in which every rest point v_p has one joint
    j(p) and a mass m_p instead of weights:

        y_p = G_j(p) (v_p; m_p),        landmark l = sum of its y_p
        dy_p/dpose[k, a] = w_ka x (y_p - m_p t_k) [j(p) at or below k] + R_j(p) P_pk df/dpose[k, a]
    """

    kinematics: Kinematics
    rest_points: RestPoints
    parents: tuple[int, ...]

    def at(self, pose: Array, betas: Array, trans: Array) -> LandmarksAt:
        """The landmarks at one pose, betas and translation."""
        return LandmarksAt(self, self.kinematics.at(pose, betas), trans)

    def each(self, poses: Array, betas: Array, trans: Array) -> list[LandmarksAt]:
        """The landmarks at M poses, betas and translations, which share their kinematics."""
        posed = self.kinematics.each(poses, betas)
        return [LandmarksAt(self, one, t) for one, t in zip(posed, trans, strict=True)]

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, L, 3) m, by matrix products."""
        (G, features), points = self.kinematics.motions(pose, betas), self.rest_points
        moved = points.moved(points.turns(G), points.rest(features, betas))
        return points.summed(moved).transpose(0, 2, 1) + trans[:, None]

    @cached_property
    def landmark(self) -> Index:
        """(P,), the landmark of each rest point."""
        P = len(self.rest_points.joint)
        return np.repeat(
            np.arange(len(self.rest_points.first)), np.diff(self.rest_points.first, append=P)
        )

    @cached_property
    def above(self) -> Array:
        """(K, K): one where a column's joint is the row's, or below it."""
        return ancestors(self.parents).T

    @cached_property
    def mass(self) -> Array:
        """(K, L), of each joint's part of each landmark."""
        return self.on_joints(self.rest_points.mass[None])[:, 0]

    @cached_property
    def mass_below(self) -> Array:
        """(K, 1, L), of the parts that turn with each joint."""
        return np.asarray(self.above @ self.mass)[:, None]

    @cached_property
    def bent(self) -> tuple[Index, Array]:
        """The joints whose features move a landmark, less the root, (U,); posedirs (U, 9, 3 P)."""
        points = self.rest_points
        joints = np.unique(points.used // 9)
        posedirs = np.zeros((9 * len(joints), points.posedirs.shape[1]))
        posedirs[9 * np.searchsorted(joints, points.used // 9) + points.used % 9] = points.posedirs
        return joints, posedirs.reshape(len(joints), 9, points.posedirs.shape[1])

    def on_joints(self, of_rest_points: Array) -> Array:
        """What rest points have (r, P), laid out by joint and landmark: (K, r, L)."""
        found = np.zeros((len(self.parents), len(of_rest_points), len(self.rest_points.first)))
        found[self.rest_points.joint, :, self.landmark] = of_rest_points.T
        return found


@dataclass(frozen=True, eq=False)
class LandmarksAt:
    """The landmarks at one pose (K, 3) rad, betas (B,) and trans (3,) m; see PointsAt."""

    of: NumericLandmarks
    posed: Posed
    trans: Array

    @cached_property
    def rest(self) -> Array:
        """v: the rest points, (3, P) m."""
        return self.of.rest_points.rest(self.posed.motion.features, self.posed.betas)

    @cached_property
    def turns(self) -> Array:
        """G of each rest point's joint, (3, 4, P)."""
        return self.of.rest_points.turns(self.posed.motion.G)

    @cached_property
    def moved(self) -> Array:
        """y: the rest points, each moved with its joint, (3, P) m."""
        return self.of.rest_points.moved(self.turns, self.rest)

    @cached_property
    def points(self) -> Array:
        """The landmarks on the posed surface, (L, 3) m."""
        return self.of.rest_points.summed(self.moved).T + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[name] (size, 3 L)."""
        slopes = self.posed.slopes
        factor = 1.0 if scale is None else scale
        for name, array in into.items():
            if name == "trans":
                found = np.tile(np.eye(3), len(self.of.rest_points.first))
            else:
                planar = self._by_pose(slopes) if name == "pose" else self._by_betas(slopes)
                found = planar.transpose(0, 2, 1).reshape(array.shape)
            np.multiply(found, factor, out=array)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        of, points = self.of, self.of.rest_points
        on_landmarks = pull.reshape(-1, 3).T  # (3, L)
        on_moved = on_landmarks[:, of.landmark]
        on_rest = np.einsum("dcp,dp->cp", self.turns[:, :3], on_moved).ravel()
        placed = of.on_joints(np.concatenate([self.rest, points.mass[None]]))  # (K, 4, L)
        on_G = np.matmul(on_landmarks, placed.transpose(0, 2, 1))
        on_features = np.zeros_like(self.posed.motion.features)
        on_features[points.used] = points.posedirs @ on_rest
        back = self.posed.adjoint(on_G, on_features)
        on_pose, through_joints = back
        return {
            "pose": on_pose.ravel(),
            "betas": points.shapedirs @ on_rest + through_joints,
            "trans": on_landmarks.sum(axis=1),
        }

    def _by_pose(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by the pose, (3 K, 3, L)."""
        of, (K, _) = self.of, self.posed.pose.shape
        placed = of.on_joints(self.moved)
        below = (of.above @ placed.reshape(K, -1)).reshape(placed.shape)
        below -= of.mass_below * self.posed.motion.joints[:, :, None]
        found: Array = np.matmul(slopes.turns, below).reshape(K, 3, 3, -1)
        joints, posedirs = of.bent
        if len(joints):
            bulge = np.matmul(slopes.d_features[joints], posedirs)  # (U, 3, 3 P)
            found[1 + joints] += self._turned(bulge).reshape(len(joints), 3, 3, -1)
        return found.reshape(3 * K, 3, -1)

    def _by_betas(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by betas, (B, 3, L)."""
        B = len(self.posed.betas)
        return (slopes.d_shift @ self.of.mass).reshape(B, 3, -1) + self._turned(
            self.of.rest_points.shapedirs
        )

    def _turned(self, rest: Array) -> Array:
        """What changes of the rest points (..., 3 P) do to the landmarks, (r, 3, L)."""
        R = self.turns[:, :3]
        planar = rest.reshape(-1, 3, R.shape[2])
        return self.of.rest_points.summed(np.einsum("dcp,rcp->rdp", R, planar))
