"""A triangle body as bones that carry its parts, which is what formats such as glTF know.

A triangle body has no bones: its surface is the solution of a linear system. In the pose of zero it
is linear in betas, as that of SMPL is, and its joints are those of this surface. So a SkinnedBody
has the same people at rest. What linear blending lacks of a pose is left to be added, vertex by
vertex, before the bones move it (`correctives.correctives_of_surfaces`). That undoes the blended
rotation of the vertex, which must be far from singular: a vertex for which it is not so in some
pose, as in a forearm that is twisted by half a turn, follows its heaviest bone alone.
"""

from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody

MOST = 4  # weights of a vertex
FLAT = 0.3  # the determinant of a blended rotation: below it, undoing it magnifies too much
TOGETHER = 32  # poses whose blended rotations are in memory at once


def blended(body: TriangleBody, poses: Array) -> SkinnedBody:
    """A SkinnedBody that is `body` at rest, for whomever, and can be corrected in poses (T, K, 3).

    Its weights are the four largest of each vertex, whose weights are the mean of its faces', since
    many programs read no more than four. It has no pose blend shapes.
    """
    rest, N, K = body.vertices(), body.n_vertices, body.n_joints
    people = np.eye(body.n_betas)
    surfaces = body.vertices(np.zeros((body.n_betas, K, 3)), people)
    found = SkinnedBody(
        template=rest,
        shapedirs=np.moveaxis(surfaces - rest, 0, 2),
        posedirs=np.zeros((N, 3, 9 * (K - 1))),
        J_regressor=body.J_regressor,
        weights=_largest(body.vertex_weights),
        parents=body.parents,
        faces=body.faces,
        joint_names=body.joint_names,
        landmarks=body.landmarks,
        name=body.name,
        card=body.card,
    )
    return replace(found, weights=_upright(found, poses))


def _largest(weights: Array) -> Array:
    """Only the largest `MOST` weights of each row of (N, K), which sum to one again."""
    order = np.argsort(-weights, axis=1, kind="stable")
    kept = weights.copy()
    np.put_along_axis(kept, order[:, MOST:], 0.0, axis=1)
    return np.asarray(kept / kept.sum(axis=1, keepdims=True))


def _upright(body: SkinnedBody, poses: Array) -> Array:
    """The weights (N, K) with which no vertex is flattened in any of the poses."""
    flat = np.zeros(body.n_vertices, dtype=bool)
    for first in range(0, len(poses), TOGETHER):
        some = poses[first : first + TOGETHER]
        G = body.kinematics.motions(some, np.zeros((len(some), body.n_betas))).G
        R = body.weights @ G[..., :3].reshape(len(some), body.n_joints, 9)
        flat |= (np.linalg.det(R.reshape(len(some), -1, 3, 3)) < FLAT).any(axis=0)
    alone = np.eye(body.n_joints)[body.weights.argmax(axis=1)]
    return np.where(flat[:, None], alone, body.weights)
