"""The SMPL function in symbols: from pose, betas and trans to points on a skinned body.

M(theta, beta) = W(T + B_S(beta) + B_P(theta), J(beta), theta)        (SMPL eq. 6)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.bodies.kinematics import binding_motions, pose_features
from workbench.geometry.rotation import rodrigues

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

Vertices = Sequence[int] | slice
ALL = slice(None)


def template(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """(3, N) m."""
    if "template" in body.free:
        return body.free["template"].symbol[:, vertices]
    return cs.MX(cs.DM(body.template[vertices].T))


def directions(body: SkinnedBody, name: str, vertices: Vertices = ALL) -> cs.MX:
    """`shapedirs` or `posedirs`, (3 N, .) over the points' columns; sparse unless free."""
    array = getattr(body, name)
    if name in body.free:
        rows = np.arange(3 * body.n_vertices).reshape(-1, 3)[vertices].ravel()
        return body.free[name].symbol.T[rows.tolist(), :]
    some = array[vertices]
    return cs.MX(cs.sparsify(cs.DM(some.reshape(3 * len(some), array.shape[2]))))


def weights(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """(N, K), sparse unless free."""
    if "weights" in body.free:
        return body.free["weights"].symbol.T[vertices, :]
    return cs.MX(cs.sparsify(cs.DM(body.weights[vertices])))


def shaped(body: SkinnedBody, betas: cs.MX, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta), (3, N) m: one person at rest, before the pose blend shapes."""
    mean = template(body, vertices)
    return mean + cs.reshape(directions(body, "shapedirs", vertices) @ betas, mean.shape)


def rest_joints(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """J(beta) = J_regressor (T + B_S(beta)), (3, K) m (SMPL eq. 10)."""
    if "J_regressor" in body.free:
        return shaped(body, betas) @ body.free["J_regressor"].symbol
    if body.free.keys() & {"template", "shapedirs"}:
        return shaped(body, betas) @ cs.MX(cs.DM(body.J_regressor.T.tocsc()))
    # numbers only: regress the mean and the directions once, N drops out
    mean = body.J_regressor @ body.template  # (K, 3)
    moves = body.J_regressor @ body.shapedirs.reshape(body.n_vertices, -1)  # (K, 3 B)
    moved = cs.DM(moves.reshape(3 * body.n_joints, body.n_betas)) @ betas
    return cs.DM(mean.T) + cs.reshape(moved, 3, body.n_joints)


def motions(body: SkinnedBody, pose: cs.MX, betas: cs.MX) -> tuple[cs.MX, list[cs.MX], cs.MX]:
    """Pose features (9 (K - 1), 1), binding motions (3, 4) per joint, posed joints (3, K) m."""
    R = rodrigues(pose)
    R_bind = rodrigues(cs.DM(body.bind_pose.T))
    G, joints = binding_motions(R, R_bind, rest_joints(body, betas), body.parents)
    return pose_features(R, R_bind), G, joints


def posed(
    body: SkinnedBody, pose: cs.MX, betas: cs.MX, trans: cs.MX, vertices: Vertices = ALL
) -> cs.MX:
    """M(theta, beta) + trans, (3, N) m."""
    features, G, _ = motions(body, pose, betas)
    rest = shaped(body, betas, vertices)
    rest += cs.reshape(directions(body, "posedirs", vertices) @ features, rest.shape)
    skinned = body.skinning(rest, G, weights(body, vertices))
    return skinned + cs.repmat(trans, 1, rest.shape[1])
