"""The kinematic chain: local rotations and rest joints in, one rigid motion per joint out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.geometry.rotation import Matrix, rodrigues

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody


def pose_features(R: Matrix, R_bind: Matrix) -> Matrix:
    """vec(R_k - R_k(bind)) row by row for every joint but the root: (3, 3 K) -> (9 (K - 1), 1).

    Entry 9 (k - 1) + 3 r + c belongs to row r, column c of joint k (SMPL eq. 9).
    """
    difference = (R - R_bind)[:, 3:]
    return cs.vertcat(*[cs.vec(part.T) for part in cs.horzsplit(difference, 3)])


def world_motions(
    R: Matrix, bones: Sequence[Matrix], parents: Sequence[int]
) -> list[tuple[Matrix, Matrix]]:
    """G_k = G_parent(k) [R_k, bone_k; 0, 1] for each joint, as pairs (rotation, position in m).

    `bones` hold each joint's place (3, 1) in its parent's frame, the root's in the world
    (SMPL eq. 4).
    """
    local = cs.horzsplit(R, 3)
    world = [(local[0], bones[0])]
    for k, parent in enumerate(parents[1:], start=1):
        world.append(followed(world[parent], local[k], bones[k]))
    return world


def followed(above: tuple[Matrix, Matrix], R: Matrix, bone: Matrix) -> tuple[Matrix, Matrix]:
    """A joint in the world: its rotation and place in the frame of the parent, which is `above`."""
    R_up, t_up = above
    return R_up @ R, R_up @ bone + t_up


def ancestors(parents: Sequence[int]) -> Array:
    """A matrix (K, K) with one at [k, m] if joint m is on the path from the root to k.

    Both ends count as on the path.
    """
    A = np.eye(len(parents))
    for k, parent in enumerate(parents[1:], start=1):
        A[k] += A[parent]
    return A


def world_rotations(pose: Matrix, parents: Sequence[int]) -> list[Matrix]:
    """The rotation (3, 3) of each joint in the world, for a pose (3, K) rad."""
    nowhere = [type(pose).zeros(3, 1)] * len(parents)
    return [R for R, _ in world_motions(rodrigues(pose), nowhere, parents)]


def bones_of(joints: Matrix, R_bind: Matrix, parents: Sequence[int]) -> list[Matrix]:
    """Each joint (3, 1) in its parent's frame, from where the joints are in the bind pose.

    For a T-pose at rest (bind pose zero) simply j_k - j_parent(k).
    """
    places = cs.horzsplit(joints, 1)
    world = [cs.horzsplit(R_bind, 3)[0]]
    bones = [places[0]]
    for k, parent in enumerate(parents[1:], start=1):
        world.append(world[parent] @ cs.horzsplit(R_bind, 3)[k])
        bones.append(world[parent].T @ (places[k] - places[parent]))
    return bones


def binding_motions(
    R: Matrix, R_bind: Matrix, joints: Matrix, parents: Sequence[int]
) -> tuple[list[Matrix], Matrix]:
    """G'_k = G_k(pose) G_k(bind)^-1, each (3, 4), and the posed joints (3, K).

    G'_k takes the rest surface, drawn in the bind pose with its `joints` (3, K), to the posed
    one; in the bind pose it is the identity (SMPL eq. 3).
    """
    bones = bones_of(joints, R_bind, parents)
    posed = world_motions(R, bones, parents)
    bound = world_motions(R_bind, bones, parents)
    motions = []
    for motion, (R_0, t_0) in zip(posed, bound, strict=True):
        motions.append(bound_motion(motion, R_0.T, t_0))
    return motions, cs.horzcat(*[t for _, t in posed])


def bound_motion(motion: tuple[Matrix, Matrix], unbind: Matrix, at_rest: Matrix) -> Matrix:
    """G' (3, 4) of a joint that is moved like this, turned by unbind' and `at_rest` when bound."""
    R, t = motion
    turn = R @ unbind
    return cs.horzcat(turn, t - turn @ at_rest)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """J(beta) = J_regressor (T + B_S(beta)) = mean + by_betas beta (SMPL eq. 10).

    These arrays do not depend on the number of vertices. If a body's joints are given, they do not
    depend on betas.

    Attributes:
        mean: (K, 3) m, the joints of the mean person.
        by_betas: (K, 3, B) m per unit of betas.
    """

    mean: Array
    by_betas: Array

    @staticmethod
    def of(body: SkinnedBody) -> Skeleton:
        """The joints of a body whose arrays are numbers."""
        N, _, B = body.shapedirs.shape
        if body.rest_joints is not None:
            return Skeleton(body.rest_joints, np.zeros((*body.rest_joints.shape, B)))
        mean = np.asarray(body.J_regressor @ body.template)
        mean.flags.writeable = False  # it is shown as an array of the body
        moved = np.asarray(body.J_regressor @ body.shapedirs.reshape(N, 3 * B))
        return Skeleton(mean, moved.reshape(len(mean), 3, B))

    def positions(self, betas: Array) -> Array:
        """The joints of the person with these betas (B,), (K, 3) m."""
        return np.asarray(self.mean + self.by_betas @ betas)

    def joints(self, betas: Matrix) -> Matrix:
        """The joints (3, K) m, for betas (B, 1) that are symbols or numbers of CasADi."""
        K, _, B = self.by_betas.shape
        moved = cs.DM(self.by_betas.reshape(3 * K, B)) @ betas
        return cs.reshape(moved, 3, K) + cs.DM(self.mean.T)
