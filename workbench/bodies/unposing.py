"""The rest shape behind a posed mesh: one linear solve."""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.posing import Posing
from workbench.bodies.forward.skinning import blend_matrices
from workbench.errors import BadBody


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
