"""The SMPL function in symbols: from pose, betas and trans to points on a skinned body.

M(theta, beta) = W(T + B_S(beta) + B_P(theta), J(beta), theta)        (SMPL eq. 6)

B_P(theta) = sum over n of f_n P_n: pose blend shapes are multiplied with features f of the pose.
SMPL takes the elements of rotation matrices; others are here too, each as a value of
`SkinnedBody.features`. STAR's read a shape coefficient as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.kinematics import Skeleton, binding_motions, pose_features
from workbench.bodies.forward.skinning import linear_blend
from workbench.errors import BadArgument, NotSupported
from workbench.geometry.rotation import quaternions_of_vectors, rodrigues

if TYPE_CHECKING:
    from workbench.bodies.body import Landmarks
    from workbench.bodies.forward.few_points import RestPoints
    from workbench.bodies.skinned import SkinnedBody


@dataclass(frozen=True, eq=False)
class Posture:
    """What features are made from: symbols, or numbers, of one person in one pose of K joints.

    Attributes:
        pose: (3, K) rad.
        bind: (3, K) rad, the pose that the template is drawn in.
        R: (3, 3 K), the rotations of `pose` side by side.
        R_bind: (3, 3 K), those of `bind`.
        betas: (B, 1), the person's shape.
    """

    pose: cs.MX
    bind: cs.MX
    R: cs.MX
    R_bind: cs.MX
    betas: cs.MX

    @staticmethod
    def of(pose: cs.MX, bind: cs.MX, betas: cs.MX) -> Posture:
        """A pose and the bind pose with their rotations, and a person's betas."""
        return Posture(pose, bind, rodrigues(pose), rodrigues(bind), betas)


Features = Callable[[Posture], cs.MX]  # -> (F, 1), zeros in the bind pose unless said otherwise


def rotation_elements(at: Posture) -> cs.MX:
    """vec(R_k - R_k(bind)), row by row, of every joint but the root: F = 9 (K - 1) (SMPL eq. 9).

    The same for every theta of one rotation, and between -2 and 2.
    """
    return pose_features(at.R, at.R_bind)


def rotation_vectors(at: Posture) -> cs.MX:
    """theta itself, less that of the bind pose, of every joint but the root: F = 3 (K - 1) rad.

    Another number for every full turn, and without bounds, though the rotation is the same.
    """
    return cs.vec((at.pose - at.bind)[:, 1:])


def quaternion_elements(at: Posture) -> cs.MX:
    """(n sin t/2, cos t/2) less those of the bind pose, joint by joint: F = 4 (K - 1).

    The features of STAR (Osman et al., ECCV 2020) that belong to the pose: 92 on 24 joints.
    Bounded; after one full turn they have the opposite quaternion, and are the same again only
    after two. `star_features` have beta_2 as well.
    """
    w, x, y, z = cs.vertsplit(quaternions_of_vectors(at.pose) - quaternions_of_vectors(at.bind), 1)
    return cs.vec(cs.vertcat(x, y, z, w)[:, 1:])


def star_features(at: Posture) -> cs.MX:
    """Quaternion elements and beta_2, the second shape coefficient: F = 4 (K - 1) + 1.

    The 93 features of STAR on 24 joints (Osman, Bolkart, Black, STAR: Sparse Trained Articulated
    Human Body Regressor, ECCV 2020), in the order of its files. Their beta_2 is a person's mass.
    The feature is linear: it adds the shape posedirs[:, :, -1] beta_2 to the rest surface in every
    pose, and the joints, which are regressed before pose blend shapes, do not move. So the features
    are zero in the bind pose only for people whose beta_2 is zero, and where joints are given a
    change of this shape cancels against one of shapedirs[:, :, 1].

    The body needs two betas. It is evaluated by its graph, without the fast arithmetic of SMPL;
    `workbench train` learns SMPL's features alone, and posedirs of these are learned as a
    `Problem` with `freed("posedirs")`, which is linear in them.
    """
    B = at.betas.shape[0]
    if B < 2:
        raise BadArgument(f"star_features need beta_2, which is not among betas of shape ({B},)")
    return cs.vertcat(quaternion_elements(at), at.betas[1])


def count_features(features: Features, K: int, B: int) -> int:
    """F, on a tree of K joints, for a person of B betas."""
    pose, bind = cs.MX.sym("pose", 3, K), cs.MX.sym("bind", 3, K)
    values = features(Posture.of(pose, bind, cs.MX.sym("betas", B)))
    return int(values.shape[0])


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
    chosen = array[vertices]
    return cs.MX(cs.sparsify(cs.DM(chosen.reshape(3 * len(chosen), array.shape[2]))))


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
