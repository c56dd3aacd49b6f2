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

    evaluate_each = evaluate  # at M motions, betas (M, B) and offsets (M, L, 3) m, alike

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
        """Numbers of the rest points (..., r, P), sorted by joint and landmark: (..., K, r, L).

        Zero where a landmark has no rest point on a joint.
        """
        points, (*some, r, _) = self.rest_points, of_rest_points.shape
        found = np.zeros((*some, len(self.ancestors), r, len(points.first)))
        found[..., points.joint, :, points.landmark] = np.moveaxis(of_rest_points, -1, 0)
        return found


@dataclass(frozen=True, eq=False)
class LandmarksAtOrigin:
    """The landmarks before translation, at one motion and betas (B,); see AtOrigin.

    `offsets` (L, 3) m displace them at rest, where there are any. Where there are M motions, betas
    (M, B) and offsets (M, L, 3) m, see ManyAtOrigin.
    """

    of: LandmarkArithmetic
    motion: Motion
    betas: Array
    offsets: Array | None = None

    def __getitem__(self, some: slice) -> LandmarksAtOrigin:
        """Those at some of the motions."""
        offsets = None if self.offsets is None else self.offsets[some]
        return LandmarksAtOrigin(self.of, self.motion[some], self.betas[some], offsets)

    @cached_property
    def rest(self) -> Array:
        """v: the rest points, (..., 3, P) m."""
        return self.of.rest_points.rest(self.motion.features, self.betas, self.offsets)

    @cached_property
    def turns(self) -> Array:
        """G of each rest point's joint, (..., 3, 4, P)."""
        return self.of.rest_points.turns(self.motion.G)

    @cached_property
    def moved(self) -> Array:
        """y: the rest points, each moved with its joint, (..., 3, P) m."""
        return self.of.rest_points.moved(self.turns, self.rest)

    @cached_property
    def points(self) -> Array:
        """The landmarks before translation, (..., L, 3) m."""
        return self.of.rest_points.summed(self.moved).swapaxes(-1, -2)

    def write_jacobian(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None
    ) -> None:
        """Write the transposed derivative into `pose`, `betas`, `trans` and `offsets`.

        Each is of the shape (size, 3 L).
        """
        for role, target in into.items():
            write(target, self.derivative(slopes, role), scale)

    def derivative(self, slopes: Slopes, role: str) -> Array:
        """The transposed derivative by `pose`, `betas`, `trans` or `offsets`, (..., size, 3 L)."""
        if role == "trans":
            return np.tile(np.eye(3), len(self.of.rest_points.first))
        if role == "offsets":
            return self._by_offsets()
        planar = self._by_pose(slopes) if role == "pose" else self._by_betas(slopes)
        *some, _, L = planar.shape
        return planar.swapaxes(-1, -2).reshape(*some[:-1], some[-1], 3 * L)

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """Gradients of cotangent (L, 3) . points by G (K, 3, 4), features and betas."""
        of, points = self.of, self.of.rest_points
        on_moved = cotangent.T[:, points.landmark]
        on_rest = np.einsum("dcp,dp->cp", self.turns[:, :3], on_moved).ravel()
        placed = of.on_joints(np.concatenate([self.rest, points.mass[None]]))  # (K, 4, L)
        on_features = np.zeros_like(self.motion.features)
        on_features[points.used] = points.posedirs @ on_rest
        on_G = np.matmul(cotangent.T, placed.transpose(0, 2, 1))
        return on_G, on_features, points.shapedirs @ on_rest

    def pulled_by_offsets(self, cotangent: Array) -> Array:
        """The gradient of cotangent (L, 3) . points by the offsets, (L, 3)."""
        return np.asarray(np.einsum("dcl,ld->lc", self._blended, cotangent))

    @cached_property
    def _blended(self) -> Array:
        """The blended rotation of each landmark, the sum of its m_p R_j(p): (..., 3, 3, L)."""
        points = self.of.rest_points
        return points.summed(self.turns[..., :3, :] * points.mass)

    def _by_offsets(self) -> Array:
        """The transposed derivative of the landmarks by their offsets, (..., 3 L, 3 L)."""
        *some, _, _, L = self._blended.shape
        found, each = np.zeros((*some, L, 3, L, 3)), np.arange(L)
        found[..., each, :, each, :] = np.moveaxis(self._blended, -1, 0).swapaxes(-1, -2)
        return found.reshape(*some, 3 * L, 3 * L)

    def _by_pose(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by the pose, (..., 3 K, 3, L)."""
        of, (*some, K, _, _) = self.of, self.motion.G.shape
        placed = of.on_joints(self.moved)
        below = (of.ancestors.T @ placed.reshape(*some, K, -1)).reshape(placed.shape)
        below -= of.mass_below * self.motion.joints[..., None]
        found: Array = np.matmul(slopes.turns, below).reshape(*some, K, 3, 3, -1)
        joints, posedirs = of.bent
        if len(joints):
            bulge = np.matmul(slopes.d_features[..., joints, :, :], posedirs)  # (U, 3, 3 P)
            turned = self._turned(bulge.reshape(*some, 3 * len(joints), -1))
            found[..., 1 + joints, :, :, :] += turned.reshape(*some, len(joints), 3, 3, -1)
        return found.reshape(*some, 3 * K, 3, -1)

    def _by_betas(self, slopes: Slopes) -> Array:
        """The transposed derivative of the landmarks by betas, (..., B, 3, L)."""
        shift = slopes.d_shift @ self.of.mass  # (3 B, L)
        turned = self._turned(self.of.rest_points.shapedirs)
        return shift.reshape(turned.shape) + turned

    def _turned(self, rest: Array) -> Array:
        """What changes of the rest points (..., r, 3 P) do to the landmarks, (..., r, 3, L)."""
        R = self.turns[..., :3, :]
        planar = rest.reshape(*rest.shape[:-1], 3, R.shape[-1])
        return self.of.rest_points.summed(np.einsum("...dcp,...rcp->...rdp", R, planar))
