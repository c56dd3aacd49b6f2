"""The SMPL function in symbols: from pose, betas and trans to points on a skinned body.

M(theta, beta) = W(T + B_S(beta) + B_P(theta), J(beta), theta)        (SMPL eq. 6)
"""

from __future__ import annotations

import casadi as cs
import numpy as np

from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.arrays import ALL, SkinnedArrays, Vertices
from workbench.bodies.forward.features import Posture
from workbench.bodies.forward.kinematics import binding_motions
from workbench.bodies.forward.skeleton import Skeleton


def template(body: SkinnedArrays, vertices: Vertices = ALL) -> cs.MX:
    """The mean person at rest, (3, N) m; a symbol if it is free."""
    if "template" in body.free:
        return body.free["template"].symbol[:, vertices]
    return cs.MX(cs.DM(body.template[vertices].T))


def directions(body: SkinnedArrays, name: str, vertices: Vertices = ALL) -> cs.MX:
    """`shapedirs` (3 N, B), or `posedirs` with a column for each pose feature; sparse unless free.

    The rows are the coordinates of the points, x, y and z of one point after the other.
    """
    array = getattr(body, name)
    if name in body.free:
        rows = np.arange(3 * body.n_vertices).reshape(-1, 3)[vertices].ravel()
        return body.free[name].symbol.T[rows.tolist(), :]
    some = array[vertices]
    return cs.MX(cs.sparsify(cs.DM(some.reshape(3 * len(some), array.shape[2]))))


def weights(body: SkinnedArrays, vertices: Vertices = ALL) -> cs.MX:
    """The skinning weights, (N, K), sparse unless they are free."""
    if "weights" in body.free:
        return body.free["weights"].symbol.T[vertices, :]
    return cs.MX(cs.sparsify(cs.DM(body.weights[vertices])))


def shaped(body: SkinnedArrays, betas: cs.MX, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta), (3, N) m: one person at rest, before the pose blend shapes."""
    mean = template(body, vertices)
    return mean + cs.reshape(directions(body, "shapedirs", vertices) @ betas, mean.shape)


def rest_joints(body: SkinnedArrays, betas: cs.MX) -> cs.MX:
    """J(beta) = J_regressor (T + B_S(beta)), (3, K) m (SMPL eq. 10); or free joints, for all."""
    if "joints" in body.free:
        return body.free["joints"].symbol
    if "J_regressor" in body.free:
        return shaped(body, betas) @ body.free["J_regressor"].symbol
    if body.rest_joints is None and body.free.keys() & {"template", "shapedirs"}:
        return shaped(body, betas) @ cs.MX(sparse_constant(body.J_regressor.T))
    return Skeleton.of(body).joints(betas)


def posture(body: SkinnedArrays, pose: cs.MX, betas: cs.MX) -> Posture:
    """A person's pose with its rotations, beside the one that the template is drawn in."""
    return Posture.of(pose, cs.DM(body.bind_pose.T), betas)


def motions(body: SkinnedArrays, at: Posture) -> tuple[list[cs.MX], cs.MX]:
    """The binding motion (3, 4) of each joint, and the posed joints (3, K) m."""
    return binding_motions(at.R, at.R_bind, rest_joints(body, at.betas), body.parents)


def rest(body: SkinnedArrays, at: Posture, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta) + B_P(theta), (3, N) m: what is skinned."""
    person = shaped(body, at.betas, vertices)
    bulges = directions(body, "posedirs", vertices) @ body.features(at)
    return person + cs.reshape(bulges, person.shape)


def posed(
    body: SkinnedArrays,
    pose: cs.MX,
    betas: cs.MX,
    trans: cs.MX,
    vertices: Vertices = ALL,
    displaced: cs.MX | None = None,
) -> cs.MX:
    """M(theta, beta) + trans, (3, N) m, with the vertices `displaced` by (3, N) m at rest."""
    at = posture(body, pose, betas)
    G, _ = motions(body, at)
    points = rest(body, at, vertices)
    if displaced is not None:
        points = points + displaced
    skinned = body.skinning(points, G, weights(body, vertices))
    return skinned + cs.repmat(trans, 1, points.shape[1])
