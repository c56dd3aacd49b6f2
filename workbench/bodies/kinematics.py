"""The kinematic chain: local rotations and rest joints in, one rigid motion per joint out."""

from collections.abc import Sequence

import casadi as cs

from workbench.geometry.rotation import Matrix


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
        R_up, t_up = world[parent]
        world.append((R_up @ local[k], R_up @ bones[k] + t_up))
    return world


def bones_of(joints: Matrix, R_bind: Matrix, parents: Sequence[int]) -> list[Matrix]:
    """Each joint (3, 1) in its parent's frame, from where the joints are in the bind pose.

    For a T-pose at rest (bind pose zero) simply j_k - j_parent(k).
    """
    at = cs.horzsplit(joints, 1)
    world = [cs.horzsplit(R_bind, 3)[0]]
    bones = [at[0]]
    for k, parent in enumerate(parents[1:], start=1):
        world.append(world[parent] @ cs.horzsplit(R_bind, 3)[k])
        bones.append(world[parent].T @ (at[k] - at[parent]))
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
    for (R_k, t_k), (R_0, t_0) in zip(posed, bound, strict=True):
        turn = R_k @ R_0.T
        motions.append(cs.horzcat(turn, t_k - turn @ t_0))
    return motions, cs.horzcat(*[t for _, t in posed])
