"""The SMPL function in symbols: from pose, betas and trans to points on a skinned body.

M(theta, beta) = W(T + B_S(beta) + B_P(theta), J(beta), theta)        (SMPL eq. 6)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.features import Posture
from workbench.bodies.forward.kinematics import Skeleton, binding_motions
from workbench.bodies.forward.skinning import linear_blend
from workbench.errors import NotSupported

if TYPE_CHECKING:
    from workbench.bodies.body import Landmarks
    from workbench.bodies.forward.few_points import RestPoints
    from workbench.bodies.skinned import SkinnedBody

Vertices = Sequence[int] | slice
ALL = slice(None)


def template(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """The mean person at rest, (3, N) m; a symbol if it is free."""
    if "template" in body.free:
        return body.free["template"].symbol[:, vertices]
    return cs.MX(cs.DM(body.template[vertices].T))


def directions(body: SkinnedBody, name: str, vertices: Vertices = ALL) -> cs.MX:
    """`shapedirs` (3 N, B), or `posedirs` with a column for each pose feature; sparse unless free.

    The rows are the coordinates of the points, x, y and z of one point after the other.
    """
    array = getattr(body, name)
    if name in body.free:
        rows = np.arange(3 * body.n_vertices).reshape(-1, 3)[vertices].ravel()
        return body.free[name].symbol.T[rows.tolist(), :]
    some = array[vertices]
    return cs.MX(cs.sparsify(cs.DM(some.reshape(3 * len(some), array.shape[2]))))


def weights(body: SkinnedBody, vertices: Vertices = ALL) -> cs.MX:
    """The skinning weights, (N, K), sparse unless they are free."""
    if "weights" in body.free:
        return body.free["weights"].symbol.T[vertices, :]
    return cs.MX(cs.sparsify(cs.DM(body.weights[vertices])))


def shaped(body: SkinnedBody, betas: cs.MX, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta), (3, N) m: one person at rest, before the pose blend shapes."""
    mean = template(body, vertices)
    return mean + cs.reshape(directions(body, "shapedirs", vertices) @ betas, mean.shape)


def rest_joints(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """J(beta) = J_regressor (T + B_S(beta)), (3, K) m (SMPL eq. 10); or free joints, for all."""
    if "joints" in body.free:
        return body.free["joints"].symbol
    if "J_regressor" in body.free:
        return shaped(body, betas) @ body.free["J_regressor"].symbol
    if body.rest_joints is None and body.free.keys() & {"template", "shapedirs"}:
        return shaped(body, betas) @ cs.MX(sparse_constant(body.J_regressor.T))
    return Skeleton.of(body).joints(betas)


def posture(body: SkinnedBody, pose: cs.MX, betas: cs.MX) -> Posture:
    """A person's pose with its rotations, beside the one that the template is drawn in."""
    return Posture.of(pose, cs.DM(body.bind_pose.T), betas)


def motions(body: SkinnedBody, at: Posture) -> tuple[list[cs.MX], cs.MX]:
    """The binding motion (3, 4) of each joint, and the posed joints (3, K) m."""
    return binding_motions(at.R, at.R_bind, rest_joints(body, at.betas), body.parents)


def rest(body: SkinnedBody, at: Posture, vertices: Vertices = ALL) -> cs.MX:
    """T + B_S(beta) + B_P(theta), (3, N) m: what is skinned."""
    person = shaped(body, at.betas, vertices)
    corrections = directions(body, "posedirs", vertices) @ body.features(at)
    return person + cs.reshape(corrections, person.shape)


def posed(
    body: SkinnedBody,
    pose: cs.MX,
    betas: cs.MX,
    trans: cs.MX,
    vertices: Vertices = ALL,
) -> cs.MX:
    """M(theta, beta) + trans, (3, N) m."""
    at = posture(body, pose, betas)
    G, _ = motions(body, at)
    points = rest(body, at, vertices)
    skinned = body.skinning(points, G, weights(body, vertices))
    return skinned + cs.repmat(trans, 1, points.shape[1])


def posed_landmarks(
    body: SkinnedBody,
    landmarks: Landmarks,
    rest_points: Callable[[], RestPoints],
    symbols: tuple[cs.MX, cs.MX, cs.MX],
    offsets: cs.MX | None = None,
) -> cs.MX:
    """The landmarks (3, L) m in the symbols of pose, betas and trans; `offsets` (3, L) m.

    Where blending is linear and no array is free, they come from their `rest_points`. Otherwise the
    vertices that carry weight are posed; then there are no offsets: raises NotSupported.
    """
    if not body.free and body.skinning is linear_blend:
        pose, betas, trans = symbols
        at = posture(body, pose, betas)
        G, _ = motions(body, at)
        means = rest_points().expression(G, body.features(at), betas, offsets)
        return means + cs.repmat(trans, 1, len(landmarks.names))
    if offsets is not None:
        raise NotSupported(
            f"landmarks of body {body.name!r} have no offsets: it has free arrays, or is not "
            "skinned by linear_blend; give its arrays values first, with body.with_values(values)"
        )
    regressor, used = landmarks.of_vertices
    return posed(body, *symbols, used) @ cs.MX(sparse_constant(regressor.T))
