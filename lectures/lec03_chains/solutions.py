"""Solutions of lecture 3."""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Array = np.ndarray


def inverse(G: Array) -> Array:
    R, t = G[:3, :3], G[:3, 3]
    answer = np.eye(4)
    answer[:3, :3] = R.T
    answer[:3, 3] = -R.T @ t
    return answer


def turned_body(vertices: Array, pelvis: Array, R: Array) -> Array:
    return (vertices - pelvis) @ R.T + pelvis


def world_rotations(R: Array, parents: list[int]) -> Array:
    world = [R[0]]
    for k in range(1, len(parents)):
        world.append(world[parents[k]] @ R[k])
    return np.array(world)


def posed_joints(R: Array, joints: Array, parents: list[int]) -> Array:
    world = world_rotations(R, parents)
    posed = [joints[0]]
    for k in range(1, len(parents)):
        up = parents[k]
        posed.append(posed[up] + world[up] @ (joints[k] - joints[up]))
    return np.array(posed)


def binding(R: Array, joints: Array, parents: list[int]) -> Array:
    world, posed = world_rotations(R, parents), posed_joints(R, joints, parents)
    G = np.tile(np.eye(4), (len(parents), 1, 1))
    G[:, :3, :3] = world
    # G_k(rest) is a translation by joint k
    G[:, :3, 3] = posed - np.einsum("kij,kj->ki", world, joints)
    return G


def tip(pose: Array, bones: Array) -> Array:
    """Where the arm ends, (3,) m."""
    R, at = np.eye(3), np.zeros(3)
    for w, bone in zip(pose, bones, strict=True):
        R = R @ Rotation.from_rotvec(w).as_matrix()
        at = at + R @ bone
    return at


def stretched(bones: Array, direction: Array) -> Array:
    """The pose in which every bone points along `direction`."""
    pose, R = np.zeros(bones.shape), np.eye(3)
    for k, bone in enumerate(bones):
        turn, _ = Rotation.align_vectors(
            [R.T @ direction], [bone]
        )  # in the frame of the joint before
        pose[k] = turn.as_rotvec()
        R = R @ turn.as_matrix()
    return pose


def reach(bones: Array, target: Array) -> Array:
    away = np.linalg.norm(target)
    straight = stretched(bones, target / away)
    if away >= np.linalg.norm(bones, axis=1).sum():
        return straight
    start = straight + 0.3 * np.random.default_rng(0).standard_normal(bones.shape)
    found = least_squares(lambda x: tip(x.reshape(-1, 3), bones) - target, start.ravel())
    return found.x.reshape(-1, 3)
