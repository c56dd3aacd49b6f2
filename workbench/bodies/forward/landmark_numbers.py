"""Landmarks on a linearly blended body in numbers: a few rest points, each on one joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.rest_points import RestPoints
from workbench.bodies.forward.rows import Target, write


@dataclass(frozen=True, eq=False)
class LandmarkArithmetic:
    """Landmarks of an SMPL body whose arrays are all numbers; see Arithmetic.

    The formulas are those of a surface (`numeric`), in which every rest point v_p has one joint
    j(p) and a mass m_p instead of weights:

        y_p = G_j(p) (v_p; m_p),        landmark l = sum of its y_p
        dy_p/dpose[k, a] = w_ka x (y_p - m_p t_k) [j(p) at or below k] + R_j(p) P_pk df/dpose[k, a]

    An offset of landmark l displaces its rest points, so that nothing else changes, and the
    derivative of the landmark by it is the sum of its m_p R_j(p).
    """

    rest_points: RestPoints
    ancestors: Array

    def evaluate(
        self, motion: Motion, betas: Array, offsets: Array | None = None
    ) -> LandmarksAtOrigin:
        """The landmarks moved by a motion, of the person with these betas (B,).

        `offsets` (L, 3) m displace them at rest, where there are any.
        """
        return LandmarksAtOrigin(self, motion, betas, offsets)

    def evaluate_batch(self, motions: Motion, betas: Array, offsets: Array | None = None) -> Array:
        """The landmarks (M, L, 3) m for M motions and betas (M, B), by matrix products.

        `offsets` (M, L, 3) m displace them at rest, where there are any.
        """
        points = self.rest_points
        rest = points.rest(motions.features, betas, offsets)
        return points.summed(points.moved(points.turns(motions.G), rest)).transpose(0, 2, 1)

    @cached_property
    def mass(self) -> Array:
        """The mass of each joint's part of each landmark, (K, L)."""
        return self.on_joints(self.rest_points.mass[None])[:, 0]

    @cached_property
    def mass_below(self) -> Array:
        """The mass of the parts that turn with each joint, (K, 1, L)."""
        return np.asarray(self.ancestors.T @ self.mass)[:, None]

    @cached_property
    def bent(self) -> tuple[Index, Array]:
        """The joints whose features move a landmark, less the root, (U,); posedirs (U, 9, 3 P)."""
        points = self.rest_points
        joints = np.unique(points.used // 9)
        posedirs = np.zeros((9 * len(joints), points.posedirs.shape[1]))
        posedirs[9 * np.searchsorted(joints, points.used // 9) + points.used % 9] = points.posedirs
        return joints, posedirs.reshape(len(joints), 9, points.posedirs.shape[1])

    def on_joints(self, of_rest_points: Array) -> Array:
        """Numbers of the rest points (r, P), sorted by joint and landmark: (K, r, L).

        Zero where a landmark has no rest point on a joint.
        """
        found = np.zeros((len(self.ancestors), len(of_rest_points), len(self.rest_points.first)))
        points = self.rest_points
        found[points.joint, :, points.landmark] = of_rest_points.T
        return found


@dataclass(frozen=True, eq=False)
class LandmarksAtOrigin:
    """The landmarks at one motion and betas (B,), before translation; see AtOrigin.

    `offsets` (L, 3) m displace them at rest, where there are any.
    """

    of: LandmarkArithmetic
    motion: Motion
    betas: Array
    offsets: Array | None = None

    @cached_property
    def rest(self) -> Array:
        """v: the rest points, (3, P) m."""
        return self.of.rest_points.rest(self.motion.features, self.betas, self.offsets)

    @cached_property
    def turns(self) -> Array:
        """G of each rest point's joint, (3, 4, P)."""
        return self.of.rest_points.turns(self.motion.G)

    @cached_property
    def moved(self) -> Array:
        """y: the rest points, each moved with its joint, (3, P) m."""
        return self.of.rest_points.moved(self.turns, self.rest)

    @cached_property
    def points(self) -> Array:
        """The landmarks before translation, (L, 3) m."""
        return self.of.rest_points.summed(self.moved).T

    def tangent(self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas`, `trans` and `offsets`.

        Each is of the shape (size, 3 L).
        """
        for name, target in into.items():
            if name == "trans":
                found = np.tile(np.eye(3), len(self.of.rest_points.first))
            elif name == "offsets":
                found = self._by_offsets()
            else:
                planar = self._by_pose(slopes) if name == "pose" else self._by_betas(slopes)
                found = planar.transpose(0, 2, 1).reshape(len(target), 3 * planar.shape[2])
            write(target, found, scale)

    def adjoint(self, pull: Array) -> tuple[Array, Array, Array]:
        """Gradients of sum(pull * points), pull (L, 3), by G (K, 3, 4), features and betas."""
        of, points = self.of, self.of.rest_points
        on_moved = pull.T[:, points.landmark]
        on_rest = np.einsum("dcp,dp->cp", self.turns[:, :3], on_moved).ravel()
        placed = of.on_joints(np.concatenate([self.rest, points.mass[None]]))  # (K, 4, L)
        on_features = np.zeros_like(self.motion.features)
        on_features[points.used] = points.posedirs @ on_rest
        on_G = np.matmul(pull.T, placed.transpose(0, 2, 1))
        return on_G, on_features, points.shapedirs @ on_rest

    def pulled_by_offsets(self, pull: Array) -> Array:
        """The gradient of sum(pull * points), pull (L, 3), by the offsets, (L, 3)."""
        return np.asarray(np.einsum("dcl,ld->lc", self._blended, pull))

    @cached_property
    def _blended(self) -> Array:
        """The blended rotation of each landmark, the sum of its m_p R_j(p): (3, 3, L)."""
        points = self.of.rest_points
        return points.summed(self.turns[:, :3] * points.mass)

    def _by_offsets(self) -> Array:
        """The transposed derivative of the landmarks by their offsets, (3 L, 3 L)."""
        L = len(self.of.rest_points.first)
        found, each = np.zeros((L, 3, L, 3)), np.arange(L)
        found[each, :, each] = self._blended.transpose(2, 1, 0)
        return found.reshape(3 * L, 3 * L)

    def _by_pose(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by the pose, (3 K, 3, L)."""
        of, K = self.of, len(self.motion.G)
        placed = of.on_joints(self.moved)
        below = (of.ancestors.T @ placed.reshape(K, -1)).reshape(placed.shape)
        below -= of.mass_below * self.motion.joints[:, :, None]
        found: Array = np.matmul(slopes.turns, below).reshape(K, 3, 3, -1)
        joints, posedirs = of.bent
        if len(joints):
            bulge = np.matmul(slopes.d_features[joints], posedirs)  # (U, 3, 3 P)
            found[1 + joints] += self._turned(bulge).reshape(len(joints), 3, 3, -1)
        return found.reshape(3 * K, 3, -1)

    def _by_betas(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by betas, (B, 3, L)."""
        B = len(self.betas)
        return (slopes.d_shift @ self.of.mass).reshape(B, 3, -1) + self._turned(
            self.of.rest_points.shapedirs
        )

    def _turned(self, rest: Array) -> Array:
        """What changes of the rest points (..., 3 P) do to the landmarks, (r, 3, L)."""
        R = self.turns[:, :3]
        planar = rest.reshape(-1, 3, R.shape[2])
        return self.of.rest_points.summed(np.einsum("dcp,rcp->rdp", R, planar))
