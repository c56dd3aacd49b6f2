"""The kinematic chain: local rotations and rest joints in, one rigid motion per joint out."""

from collections.abc import Sequence

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.geometry.rotation import Matrix, rodrigues


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


def local_slopes(pose: cs.SX, R: cs.SX) -> list[list[cs.SX]]:
    """dR_k/dpose[a, k], three (3, 3) for each joint, of the local rotations R (3, 3 K)."""
    slopes = []
    for k, R_k in enumerate(cs.horzsplit(R, 3)):
        columns = cs.horzsplit(cs.jacobian(cs.vec(R_k), pose[:, k]), 1)
        slopes.append([cs.reshape(column, 3, 3) for column in columns])
    return slopes


def turning_axes(
    slopes: Sequence[Sequence[cs.SX]], R: cs.SX, above: Sequence[cs.SX]
) -> list[cs.SX]:
    """The axis w (3, 1) of each number of a pose (3, K), joint by joint: 3 K of them.

    When pose[a, k] grows, everything at and below joint k turns about w in the world: its
    rotations change by [w]x R. R (3, 3 K) are the local rotations, `slopes` their derivatives, and
    `above` the rotations of the joints' parents in the world.
    """
    axes = []
    for k, R_k in enumerate(cs.horzsplit(R, 3)):
        for D in slopes[k]:  # [own axis]x R_k
            own = cs.vertcat(*[cs.dot(D[r, :], R_k[c, :]) for r, c in ((2, 1), (0, 2), (1, 0))])
            axes.append(above[k] @ own)
    return axes


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
    for motion, (R_0, t_0) in zip(posed, bound, strict=True):
        motions.append(bound_motion(motion, R_0.T, t_0))
    return motions, cs.horzcat(*[t for _, t in posed])


def bound_motion(motion: tuple[Matrix, Matrix], unbind: Matrix, at_rest: Matrix) -> Matrix:
    """G' (3, 4) of a joint that is moved like this, turned by unbind' and `at_rest` when bound."""
    R, t = motion
    turn = R @ unbind
    return cs.horzcat(turn, t - turn @ at_rest)
