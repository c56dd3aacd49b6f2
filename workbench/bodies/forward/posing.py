"""Many poses of one tree at once, in the form in which skinning is linear; and its inverse.

With A the ancestors, c = w A the weight at or below each joint, and D_m = R_parent(m) - R_m,

    posed_i = (sum_k w_ik R_k) rest_i + sum_m c_im D_m j_m + trans        (SMPL eq. 2 to 4)

because a joint's binding motion takes v to R_k v + sum over m on the path to k of D_m j_m. So
the posed points are linear in everything but the rotations, also in the joints j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.skinning import blend_matrices
from workbench.errors import BadBody
from workbench.geometry.rotation import CROSS, crossed, matrix_from_vector, vector_from_matrix

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody


@dataclass(frozen=True, eq=False)
class Posing:
    """The rotations of K joints in J poses of one tree whose bind pose is zero.

    Attributes:
        parents: the parent of each joint.
        local: (J, K, 3, 3) each joint's rotation in its parent's frame.
        world: (J, K, 3, 3) each joint's rotation in the world.
    """

    parents: tuple[int, ...]
    local: Array
    world: Array

    @staticmethod
    def of(poses: Array, parents: Sequence[int]) -> Posing:
        """The rotations of poses (J, K, 3) rad, given as rotation vectors."""
        local = matrix_from_vector(poses)
        return Posing(tuple(parents), local, world_rotations(local, parents))

    @property
    def features(self) -> Array:
        """The pose features (J, 9 (K - 1)): vec(R_k - I) row by row of all joints but the root."""
        away = self.local[:, 1:] - np.eye(3)
        return away.reshape(len(away), -1)

    @property
    def above(self) -> Array:
        """The world rotation of each joint's parent, (J, K, 3, 3); the identity for the root."""
        above = np.empty_like(self.world)
        above[:, 0] = np.eye(3)
        above[:, 1:] = self.world[:, list(self.parents[1:])]
        return above

    @property
    def levers(self) -> Array:
        """The matrices D of the equation above, (J, K, 3, 3)."""
        return self.above - self.world

    def turned(self, by: Array) -> Posing:
        """The poses after a further turn of each joint in its parent's frame, (J, K, 3) rad."""
        return Posing.of(vector_from_matrix(matrix_from_vector(by) @ self.local), self.parents)

    @property
    def poses(self) -> Array:
        """Rotation vectors (J, K, 3) rad."""
        return vector_from_matrix(self.local)

    def only(self, some: slice) -> Posing:
        """The poses of these rows."""
        return Posing(self.parents, self.local[some], self.world[some])

    # The derivative with respect to a small turn of each joint in its parent's frame, and back.

    def turning(self, turn: Array) -> tuple[Array, Array]:
        """How world (J, K, 3, 3) and local rotations change with a turn (J, K, 3) rad."""
        in_world = (self.above @ turn[..., None])[..., 0]
        A = ancestors(self.parents)
        whole = np.einsum("km,jma->jka", A, in_world)
        return crossed(whole) @ self.world, crossed(turn) @ self.local

    def turning_back(self, on_world: Array, on_local: Array) -> Array:
        """The adjoint of `turning`: the gradient (J, K, 3) by the turn, from those by rotations."""
        A = ancestors(self.parents)
        torque = np.einsum("km,jka->jma", A, axial(on_world, self.world))
        by_world: Array = (self.above.swapaxes(-1, -2) @ torque[..., None])[..., 0]
        return by_world + axial(on_local, self.local)


def world_rotations(local: Array, parents: Sequence[int]) -> Array:
    """Rotations (..., K, 3, 3) in the world, from those in the parents' frames."""
    world = local.copy()
    for k, parent in enumerate(parents[1:], start=1):
        world[..., k, :, :] = world[..., parent, :, :] @ local[..., k, :, :]
    return world


def local_rotations(world: Array, parents: Sequence[int]) -> Array:
    """Rotations (..., K, 3, 3) in the parents' frames, from those in the world."""
    local = world.copy()
    above = world[..., list(parents[1:]), :, :]
    local[..., 1:, :, :] = above.swapaxes(-1, -2) @ world[..., 1:, :, :]
    return local


def axial(cotangent: Array, G: Array) -> Array:
    """The gradient (..., 3) by w of sum(cotangent * [w]x G), for G (..., 3, n)."""
    X = cotangent @ G.swapaxes(-1, -2)
    return np.asarray(X.reshape(*X.shape[:-2], 9) @ CROSS.T)


def unpose(body: SkinnedBody, pose: Array, vertices: Array) -> Array:
    """T (N, 3) m with W(T + B_P(theta), J_regressor T, theta) = V, for V (N, 3) m in pose (K, 3).

    Where the body has joints of its own, they take the place of J_regressor T.

    Skinning is linear in the rest shape, its joints included: V_i = M_i (T_i + P_i f) + sum_m
    c_im D_m (J_regressor T)_m. The M_i are 3 x 3, the joints few, so what is to be solved is 3 K
    equations for the joints. T stands where the posed root stands: translation is not sought.

    Raises BadBody for a body whose skinning or features are not SMPL's.
    """
    if not body.is_smpl:
        raise BadBody(
            f"body {body.name!r} cannot be unposed: that takes linear_blend and rotation_elements"
        )
    posing = Posing.of(np.asarray(pose, dtype=float).reshape(1, body.n_joints, 3), body.parents)
    N, K = body.weights.shape
    M = blend_matrices(body.weights, posing.world[0])
    carried = body.weights @ ancestors(body.parents)
    straight = np.linalg.solve(M, vertices[..., None])[..., 0]
    without_joints = straight - body.posedirs @ posing.features[0]
    # T = without_joints - M^-1 sum_m c_m D_m j_m; the joints are the regressor's of that
    levers = posing.levers[0].transpose(1, 0, 2).reshape(3, 3 * K)  # columns (m, b)
    by_joints = np.linalg.solve(M, np.broadcast_to(levers, (N, 3, 3 * K)))
    by_joints = by_joints * np.repeat(carried, 3, axis=1)[:, None, :]  # (N, 3, 3 K)
    if body.rest_joints is not None:
        joints = body.rest_joints.ravel()
    else:
        system = np.eye(3 * K) + (body.J_regressor @ by_joints.reshape(N, -1)).reshape(3 * K, 3 * K)
        joints = np.linalg.solve(system, (body.J_regressor @ without_joints).ravel())
    return np.asarray(without_joints - by_joints @ joints)
