"""Triangle bodies on the skeleton of a skinned one, before anything is learned."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles.body import TriangleBody
from workbench.errors import BadBody
from workbench.geometry.triangles import gradient_derivatives


def blend_scape(body: SkinnedBody, n_near: int = 2) -> TriangleBody:
    """BlendSCAPE on a skinned body's mesh, tree and shape space; its posedirs are zero.

    A face's weights are the mean of its corners'. Its shapedirs are the gradients of the body's,
    so that unposed both have the same vertices. Each face feels the twists of the `n_near` joints
    nearest to it, of those where its part meets others. The card is the skinned body's, whose
    numbers these are; its `extras` stay behind.

    Raises BadBody for a body that is drawn in another pose than zero, whose joints are given, or
    whose mesh is in pieces.
    """
    if body.bind_pose.any():
        raise BadBody(
            f"body {body.name!r} is drawn in a bent pose; a triangle body's template is unposed"
        )
    if body.rest_joints is not None:
        raise BadBody(
            f"body {body.name!r} is given its joints, and a triangle body finds them on its "
            "surface; give it a J_regressor, with dataclasses.replace(body, rest_joints=None)"
        )
    corners = body.weights[body.faces]  # (F, 3, K)
    weights = corners.mean(axis=1)
    joints = body.numeric.skeleton.mean
    near = nearest_joints(
        body.template[body.faces].mean(axis=1), joints, weights.argmax(axis=1), body.parents, n_near
    )
    return TriangleBody(
        template=body.template,
        faces=body.faces,
        shapedirs=gradient_derivatives(body.template, body.shapedirs, body.faces),
        posedirs=np.zeros((len(body.faces), 3, 3, 3 * near.shape[1])),
        near=near,
        weights=csr_array(weights),
        J_regressor=body.J_regressor,
        parents=body.parents,
        joint_names=body.joint_names,
        landmarks=body.landmarks,
        name=f"{body.name}, BlendSCAPE",
        card={"made_of": f"body {body.name!r}, whose card follows", **body.card},
    )


def scape(body: SkinnedBody, n_near: int = 2) -> TriangleBody:
    """SCAPE: as `blend_scape`, each face following the one part that it belongs to most."""
    return one_part(blend_scape(body, n_near), f"{body.name}, SCAPE")


def one_part(body: TriangleBody, name: str) -> TriangleBody:
    """A triangle body whose faces each follow the part of their largest weight alone."""
    part = body.weights.toarray().argmax(axis=1)
    hot = csr_array((np.ones(len(part)), (np.arange(len(part)), part)), shape=body.weights.shape)
    return replace(body, weights=hot, name=name)


def nearest_joints(
    middles: Array, joints: Array, part: Index, parents: tuple[int, ...], count: int
) -> Index:
    """For faces with these `middles` (F, 3) m on these parts (F,) the joints they feel, (F, count).

    First come the joints where the part meets others, its own and its children's, the nearest
    first; then, where these are too few, the nearest of the others. The root bends nothing; fewer
    than `count` joints give fewer columns.
    """
    K = len(parents)
    count = min(count, K - 1)
    up = np.array(parents)
    meets = (np.arange(K) == part[:, None]) | (up == part[:, None])  # (F, K)
    distances = np.linalg.norm(middles[:, None] - joints, axis=2)
    far = 1 + distances.max(initial=0.0)
    order = np.argsort((distances + far * ~meets)[:, 1:], axis=1, kind="stable")
    return np.asarray(1 + order[:, :count], dtype=np.int64)
