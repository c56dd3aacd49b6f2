"""SMPL and STAR as their papers write them: 4 x 4 matrices, SciPy's rotations, no code of ours."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from workbench import SkinnedBody

Array = np.ndarray


def smpl_features(pose: Array, bind: Array, betas: Array) -> Array:
    """The entries of R - R_0 of all joints but the root, row by row."""
    R, R0 = (Rotation.from_rotvec(theta).as_matrix() for theta in (pose, bind))
    return np.asarray((R - R0)[1:].ravel())


def star_features(pose: Array, bind: Array, betas: Array) -> Array:
    """Half angles of all joints but the root, and beta_2 (Osman et al., 2020)."""
    angles = np.linalg.norm(pose[1:], axis=1, keepdims=True)
    quaternions = np.hstack([np.sin(angles / 2) / angles * pose[1:], np.cos(angles / 2) - 1])
    return np.append(quaternions, betas[1])


def smpl(
    body: SkinnedBody,
    pose: Array,
    betas: Array,
    trans: Array,
    features: Callable[[Array, Array, Array], Array] = smpl_features,
) -> tuple[Array, Array]:
    """Vertices (N, 3) and posed joints (K, 3) for one pose (K, 3), betas (B,), trans (3,)."""
    shaped, bind = body.template + body.shapedirs @ betas, body.bind_pose
    joints = body.J_regressor.toarray() @ shaped
    rest = shaped + body.posedirs @ features(pose, bind, betas)
    R, R0 = (Rotation.from_rotvec(theta).as_matrix() for theta in (pose, bind))
    # where each joint's frame is in the bind pose, and from there in its parent's frame
    bound, world = [_motion(R0[0], joints[0])], [_motion(R[0], joints[0])]
    for k in range(1, len(body.parents)):
        up = body.parents[k]
        offset = (np.linalg.inv(bound[up]) @ (*joints[k], 1))[:3]
        bound.append(bound[up] @ _motion(R0[k], offset))
        world.append(world[up] @ _motion(R[k], offset))
    motions = np.array([G @ np.linalg.inv(B) for G, B in zip(world, bound, strict=True)])
    blended = np.einsum("nk,kij->nij", body.weights, motions)
    vertices = np.einsum("nij,nj->ni", blended, np.c_[rest, np.ones(len(rest))])[:, :3]
    return vertices + trans, np.array([G[:3, 3] for G in world]) + trans


def _motion(R: Array, t: Array) -> Array:
    return np.block([[R, t[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
