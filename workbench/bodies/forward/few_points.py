"""Joints and landmarks in numbers, for one pose or many: as few points as need no mesh.

With t_k the posed joint k, and w_ka the axis about which the world turns with pose[k, a],

    dt_j/dpose[k, a] = w_ka x (t_j - t_k)   for every j below k, zero for all others.

A landmark is a weighted mean of vertices, and linear blending is linear in these: it is the sum of
a few rest points v_p, each of which moves with one joint j(p) alone and has a mass m_p, the sum of
the weights behind it. The formulas are those of a surface (`mesh`) otherwise:

    y_p = G_j(p) (v_p; m_p),        landmark l = sum of its y_p
    dy_p/dpose[k, a] = w_ka x (y_p - m_p t_k) [j(p) at or below k] + R_j(p) P_pk df/dpose[k, a]

An offset of landmark l displaces its rest points, so that nothing else changes, and the derivative
of the landmark by it is the sum of its m_p R_j(p).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.motion import JointMotion, MotionDerivatives, PointsAtMotion
from workbench.bodies.forward.named_points import RowTarget, write
from workbench.bodies.forward.skinning import blend_points

if TYPE_CHECKING:
    from workbench.bodies.capsules import Capsules
    from workbench.bodies.skinned import SkinnedBody


@lru_cache
def _by_trans(N: int) -> Array:
    """The transposed derivative of N points by a translation, (3, 3 N)."""
    return np.tile(np.eye(3), N)


@dataclass(frozen=True, eq=False)
class RestPoints:
    """Rest points for each pair of a landmark and a joint that moves it, P of them, planar.

    Attributes:
        joint: (P,) the joint that moves each rest point.
        first: (L,) the first rest point of each landmark.
        used: the features that move any of them.
        template: (3 P,) m.
        shapedirs: (B, 3 P).
        posedirs: (used, 3 P).
        mass: (P,) the sum of the weights behind each rest point.
    """

    joint: Index
    first: Index
    used: Index
    template: Array
    shapedirs: Array
    posedirs: Array
    mass: Array

    @staticmethod
    def of(body: SkinnedBody, vertices: Sequence[int], regressor: csr_array) -> RestPoints:
        """The rest points of landmarks, by a regressor (L, n) of the numbered vertices."""
        r, rows = regressor.toarray(), list(vertices)
        mixed = np.einsum("li,ij->lji", r, body.weights[rows])  # (L, K, n)
        landmark, joint = np.nonzero(abs(mixed).sum(axis=2))
        # a landmark without weight still has a place
        empty = np.setdiff1d(np.arange(len(r)), landmark)
        landmark, joint = np.append(landmark, empty), np.append(joint, 0 * empty)
        order = np.argsort(landmark, kind="stable")
        landmark, joint = landmark[order], joint[order]
        A = mixed[landmark, joint]  # (P, n)

        def summed(arrays: Array) -> Array:  # (n, 3, b) -> (b, 3 P)
            planar = np.tensordot(A, arrays, axes=(1, 0)).transpose(2, 1, 0)
            return np.ascontiguousarray(planar).reshape(-1, 3 * len(A))

        posedirs = summed(body.posedirs[rows])
        used = np.flatnonzero(abs(posedirs).max(axis=1, initial=0))
        return RestPoints(
            joint,
            np.searchsorted(landmark, np.arange(len(r))),
            used,
            summed(body.template[rows][:, :, None])[0],
            summed(body.shapedirs[rows]),
            np.ascontiguousarray(posedirs[used]),
            A.sum(axis=1),
        )

    @staticmethod
    def rigid(joints: Index, places: Array, by_betas: Array) -> RestPoints:
        """Landmarks (L, 3) m that each move with one joint, as betas move them (L, 3, B)."""
        L, B = len(joints), by_betas.shape[2]
        return RestPoints(
            joints,
            np.arange(L),
            np.zeros(0, dtype=np.int64),
            places.T.ravel(),
            by_betas.transpose(2, 1, 0).reshape(B, 3 * L),
            np.zeros((0, 3 * L)),
            np.ones(L),
        )

    @staticmethod
    def of_capsules(capsules: Capsules) -> RestPoints:
        """The ends of capsules."""
        P = 2 * len(capsules.names)
        by_betas = capsules.end_slopes.reshape(P, 3, -1)
        return RestPoints.rigid(
            np.repeat(capsules.joints, 2), capsules.ends.reshape(P, 3), by_betas
        )

    @cached_property
    def landmark(self) -> Index:
        """The landmark of each rest point, (P,)."""
        counts = np.diff(self.first, append=len(self.joint))
        return np.repeat(np.arange(len(self.first)), counts)

    def summed(self, of_rest_points: Array) -> Array:
        """The sums over each landmark's rest points, (..., P) -> (..., L)."""
        return np.add.reduceat(of_rest_points, self.first, axis=-1)

    def expression(
        self, G: Sequence[cs.MX], features: cs.MX, betas: cs.MX, offsets: cs.MX | None = None
    ) -> cs.MX:
        """The landmarks in symbols, (3, L) m, before translation; displaced by offsets (3, L) m."""
        P, L = len(self.joint), len(self.first)
        shaped = cs.sparsify(cs.DM(self.shapedirs.T)) @ betas
        corrected = cs.sparsify(cs.DM(self.posedirs.T)) @ features[self.used.tolist()]
        rest = cs.reshape(cs.DM(self.template) + shaped + corrected, P, 3).T  # (3, P)
        if offsets is not None:
            displaced = csc_array((self.mass, (self.landmark, np.arange(P))), shape=(L, P))
            rest = rest + offsets @ sparse_constant(displaced)
        by_joint = csc_array((np.ones(P), (np.arange(P), self.joint)), shape=(P, len(G)))
        moved = blend_points(rest, cs.DM(self.mass), G, sparse_constant(by_joint))
        edges = np.append(self.first, P)
        means = csc_array((np.ones(P), np.arange(P), edges), shape=(P, L))
        return moved @ sparse_constant(means)


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Landmarks of an SMPL body whose arrays are all numbers.

    `joints` says whether they are its joints, which the motion knows to the bit.
    """

    rest_points: RestPoints
    ancestors: Array
    joints: bool = False

    @staticmethod
    def of_joints(skeleton: Skeleton, ancestors: Array) -> LandmarkPoints:
        """The posed joints of a body."""
        joints = np.arange(len(ancestors))
        points = RestPoints.rigid(joints, skeleton.mean, skeleton.by_betas)
        return LandmarkPoints(points, ancestors, joints=True)

    def at(
        self, motion: JointMotion, betas: Array, offsets: Array | None = None
    ) -> LandmarkPointsAt:
        """The landmarks moved by a motion, or several, of the person with these betas (..., B).

        `offsets` (..., L, 3) m displace them at rest, where there are any.
        """
        return LandmarkPointsAt(self, motion, betas, offsets)

    @cached_property
    def mass(self) -> Array:
        """The mass of each joint's part of each landmark, (K, L)."""
        return self.on_joints(self.rest_points.mass[None])[:, 0]

    @cached_property
    def by_betas(self) -> Array:
        """How betas move each rest point, (P, 3, B)."""
        flat, P = self.rest_points.shapedirs, len(self.rest_points.joint)
        return np.ascontiguousarray(flat.reshape(len(flat), 3, P).transpose(2, 1, 0))

    @cached_property
    def mass_below(self) -> Array:
        """The mass of the parts that turn with each joint, (K, 1, L)."""
        return np.asarray(self.ancestors.T @ self.mass)[:, None]

    @cached_property
    def corrected(self) -> tuple[Index, Array]:
        """The joints with posedirs for any landmark, (U,), and these, (U, 9, 3 P)."""
        points = self.rest_points
        joints = np.unique(points.used // 9)
        posedirs = np.zeros((9 * len(joints), points.posedirs.shape[1]))
        posedirs[9 * np.searchsorted(joints, points.used // 9) + points.used % 9] = points.posedirs
        return 1 + joints, posedirs.reshape(len(joints), 9, points.posedirs.shape[1])

    def on_joints(self, of_rest_points: Array) -> Array:
        """Numbers of the rest points (..., r, P), sorted by joint and landmark: (..., K, r, L).

        Zero where a landmark has no rest point on a joint.
        """
        points, (*batch, r, _) = self.rest_points, of_rest_points.shape
        sorted_numbers = np.zeros((*batch, len(self.ancestors), r, len(points.first)))
        sorted_numbers[..., points.joint, :, points.landmark] = np.moveaxis(of_rest_points, -1, 0)
        return sorted_numbers


@dataclass(frozen=True, eq=False)
class LandmarkPointsAt(PointsAtMotion):
    """The landmarks before translation, at one motion, betas (B,) and offsets (L, 3) m, or several.

    There may be no offsets.
    """

    of: LandmarkPoints
    motion: JointMotion
    betas: Array
    offsets: Array | None = None

    def __getitem__(self, some: slice) -> LandmarkPointsAt:
        """Those at some of the motions."""
        offsets = None if self.offsets is None else self.offsets[some]
        return LandmarkPointsAt(self.of, self.motion[some], self.betas[some], offsets)

    @cached_property
    def rest(self) -> Array:
        """v: the rest points, (..., 3, P) m."""
        of, features = self.of.rest_points, self.motion.features
        flat = self.betas @ of.shapedirs + features[..., of.used] @ of.posedirs + of.template
        rest = flat.reshape(*flat.shape[:-1], 3, -1)
        if self.offsets is None:
            return rest
        return np.asarray(rest + of.mass * np.swapaxes(self.offsets[..., of.landmark, :], -1, -2))

    @cached_property
    def G(self) -> Array:
        """The motion of each rest point's joint, (..., 3, 4, P)."""
        motions = self.motion.G[..., self.of.rest_points.joint, :, :]
        return np.ascontiguousarray(np.moveaxis(motions, -3, -1))

    @cached_property
    def moved(self) -> Array:
        """y: the rest points, each moved with its joint, (..., 3, P) m."""
        turned: Array = np.einsum("...dcp,...cp->...dp", self.G[..., :3, :], self.rest)
        return turned + self.G[..., 3, :] * self.of.rest_points.mass

    @cached_property
    def points(self) -> Array:
        """The landmarks before translation, (..., L, 3) m."""
        if self.of.joints:
            return self.motion.joints
        return self.of.rest_points.summed(self.moved).swapaxes(-1, -2)

    def write_jacobian(
        self, by: MotionDerivatives, into: Mapping[str, RowTarget], scale: Array | None
    ) -> None:
        """Write the transposed derivative into[role] (size, 3 L)."""
        for role, target in into.items():
            write(target, self.derivative(by, role), scale)

    def derivative(self, by: MotionDerivatives, role: str) -> Array:
        """The transposed derivative by `pose`, `betas`, `trans` or `offsets`, (..., size, 3 L)."""
        L = len(self.of.rest_points.first)
        if role == "trans":
            return _by_trans(L)
        if role == "offsets":
            landmarks, turned = np.arange(L), np.moveaxis(self._blended, -1, 0).swapaxes(-1, -2)
            blocks = np.zeros((*self._blended.shape[:-3], L, 3, L, 3))
            blocks[..., landmarks, :, landmarks, :] = turned
            return blocks.reshape(*blocks.shape[:-4], 3 * L, 3 * L)
        planar = self._by_pose(by) if role == "pose" else self._by_betas(by)
        return planar.swapaxes(-1, -2).reshape(*planar.shape[:-2], 3 * L)

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """Gradients of cotangent (L, 3) . points by G (K, 3, 4), features and betas."""
        of, points = self.of, self.of.rest_points
        on_moved = cotangent.T[:, points.landmark]
        on_rest = np.einsum("dcp,dp->cp", self.G[:, :3], on_moved).ravel()
        placed = of.on_joints(np.concatenate([self.rest, points.mass[None]]))  # (K, 4, L)
        on_features = np.zeros_like(self.motion.features)
        on_features[points.used] = points.posedirs @ on_rest
        on_G = np.matmul(cotangent.T, placed.transpose(0, 2, 1))
        return on_G, on_features, points.shapedirs @ on_rest

    def vjp_of_offsets(self, cotangent: Array) -> Array:
        """The gradient of cotangent (L, 3) . points by the offsets, (L, 3)."""
        return np.asarray(np.einsum("dcl,ld->lc", self._blended, cotangent))

    @cached_property
    def _blended(self) -> Array:
        """The blended rotation of each landmark, the sum of its m_p R_j(p): (..., 3, 3, L)."""
        points = self.of.rest_points
        return points.summed(self.G[..., :3, :] * points.mass)

    def _by_pose(self, by: MotionDerivatives) -> Array:
        """The transposed derivative of the landmarks by the pose, (..., 3 K, 3, L)."""
        of, (*batch, K, _, _) = self.of, self.motion.G.shape
        t = self.motion.joints
        if of.joints:
            below = t.swapaxes(-1, -2)[..., None, :, :] - t[..., None]  # (K, 3, K): from k to j
            below *= of.ancestors.T[:, None]
        else:
            placed = of.on_joints(self.moved)
            below = (of.ancestors.T @ placed.reshape(*batch, K, -1)).reshape(placed.shape)
            below -= of.mass_below * t[..., None]
        derivative: Array = np.matmul(by.turns, below).reshape(*batch, K, 3, 3, -1)
        joints, posedirs = of.corrected
        if U := len(joints):
            d_features = by.d_features[..., joints, :, :].swapaxes(-1, -2)
            d_rest = np.matmul(d_features, posedirs)  # (U, 3, 3 P)
            turned = self._turned(d_rest.reshape(*batch, 3 * U, -1))
            derivative[..., joints, :, :, :] += turned.reshape(*batch, U, 3, 3, -1)
        return derivative.reshape(*batch, 3 * K, 3, -1)

    def _by_betas(self, by: MotionDerivatives) -> Array:
        """The transposed derivative of the landmarks by betas, (..., B, 3, L)."""
        of, points = self.of, self.of.rest_points
        turned = self.motion.G[..., points.joint, :, :3] @ of.by_betas  # (P, 3, B)
        moved = turned if of.joints else np.add.reduceat(turned, points.first, axis=-3)
        shift = by.d_shift if of.joints else of.mass.T @ by.d_shift  # (B, L, 3)
        return np.asarray(shift.swapaxes(-1, -2) + moved.swapaxes(-1, -3))

    def _turned(self, rest: Array) -> Array:
        """What changes of the rest points (..., r, 3 P) do to the landmarks, (..., r, 3, L)."""
        R = self.G[..., :3, :]
        planar = rest.reshape(*rest.shape[:-1], 3, R.shape[-1])
        return self.of.rest_points.summed(np.einsum("...dcp,...rcp->...rdp", R, planar))
