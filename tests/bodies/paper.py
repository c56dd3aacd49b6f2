"""SMPL as its paper writes it: loops, 4 x 4 matrices, SciPy's rotations, no code of ours."""

import numpy as np
from scipy.spatial.transform import Rotation

from workbench import SkinnedBody


def smpl(
    body: SkinnedBody, pose: np.ndarray, betas: np.ndarray, trans: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 3) and posed joints (K, 3) for one pose (K, 3), betas (B,), trans (3,)."""
    N, K, B = body.n_vertices, len(body.parents), body.shapedirs.shape[2]
    regressor = body.J_regressor.toarray()
    bind = body.bind_pose
    R = [Rotation.from_rotvec(pose[k]).as_matrix() for k in range(K)]
    R0 = [Rotation.from_rotvec(bind[k]).as_matrix() for k in range(K)]

    shaped = body.template.copy()
    for b in range(B):
        shaped = shaped + betas[b] * body.shapedirs[:, :, b]
    joints = np.array([sum(regressor[k, i] * shaped[i] for i in range(N)) for k in range(K)])

    rest = shaped.copy()
    for k in range(1, K):
        for r in range(3):
            for c in range(3):
                n = 9 * (k - 1) + 3 * r + c
                rest = rest + (R[k][r, c] - R0[k][r, c]) * body.posedirs[:, :, n]

    # where each joint's frame is in the bind pose, and from there in its parent's frame
    bound = [_motion(np.eye(3), joints[0]) @ _motion(R0[0], np.zeros(3))]
    local_offset = [joints[0]]
    for k in range(1, K):
        up = bound[body.parents[k]]
        local_offset.append((np.linalg.inv(up) @ (*joints[k], 1))[:3])
        bound.append(up @ _motion(R0[k], local_offset[k]))

    world = []
    for k in range(K):
        local = _motion(R[k], local_offset[k])
        world.append(local if k == 0 else world[body.parents[k]] @ local)

    vertices = np.zeros((N, 3))
    for i in range(N):
        blended = np.zeros((4, 4))
        for k in range(K):
            blended = blended + body.weights[i, k] * world[k] @ np.linalg.inv(bound[k])
        vertices[i] = (blended @ (*rest[i], 1))[:3] + trans
    return vertices, np.array([G[:3, 3] for G in world]) + trans


def _motion(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.block([[R, t[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
