"""Bodies as the scripts of a page take them: smpl.js, and scape.js of the page of sliders."""

from typing import Any

import numpy as np

from workbench.bodies import SkinnedBody
from workbench.bodies.body import why_not_skinned
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.geometry.triangles import banded_factor
from workbench.replay.packing import packed

MOST_WEIGHTS = 4  # per vertex, as in SMPL
MOST_STITCHED = 2_000  # vertices: beyond, the factor of the stitching makes the page too large


def skinned_data(body: SkinnedBody, kind: str = "f8") -> dict[str, Any]:
    """The arrays for smpl.js; numbers but those of pose blend shapes are of the kind f4 or f8.

    Raises BadArgument for a body that is not SMPL's, is not bound in the pose zero, has free arrays
    or more than four weights in a vertex, or more than 65,536 vertices.
    """
    if other := why_not_skinned(body, "the page of sliders", "body.vertices(pose) moves it"):
        raise BadArgument(other)
    most = int(np.count_nonzero(body.weights, axis=1).max())
    for wrong, why in (
        (not body.is_smpl, "is not blended linearly with features of rotation elements"),
        (body.bind_pose.any(), "is drawn in a pose that is not zero"),
        (body.free, "has free arrays; give them values first"),
        (most > MOST_WEIGHTS, f"has {most} weights in a vertex, and the page knows four"),
        (body.n_vertices > 2**16, f"has {body.n_vertices:,} vertices, and the page knows 65,536"),
    ):
        if wrong:
            raise BadArgument(f"body {body.name!r} {why}; the page cannot show it")
    carriers = np.argsort(-body.weights, axis=1, kind="stable")[:, :MOST_WEIGHTS]
    carriers = np.pad(carriers, ((0, 0), (0, MOST_WEIGHTS - carriers.shape[1])))
    shares = np.take_along_axis(body.weights, carriers, axis=1)
    shares[:, body.n_joints :] = 0  # where there are fewer joints than weights
    skeleton = body.numeric.skeleton
    return {
        "model": "SMPL",
        **_common(body, kind),
        "shapedirs": packed(body.shapedirs.transpose(2, 0, 1), kind),
        "joints_mean": packed(skeleton.mean, kind),
        "joints_move": packed(skeleton.by_betas.transpose(2, 0, 1), kind),
        "weights": packed(shares, kind),
        "carriers": packed(carriers, "u2"),
        "bulges": [_bulge(body, k) for k in range(1, body.n_joints)],
    }


def triangle_data(body: TriangleBody) -> dict[str, Any]:
    """The arrays for scape.js.

    Raises BadArgument for a body with free arrays, or of more than 2,000 vertices.
    """
    for wrong, why in (
        (body.free, "has free arrays; give them values first"),
        (
            body.n_vertices > MOST_STITCHED,
            f"has {body.n_vertices:,} vertices, and the page stitches up to {MOST_STITCHED:,}",
        ),
    ):
        if wrong:
            raise BadArgument(f"body {body.name!r} {why}; the page cannot show it")
    factor, order = banded_factor(body.stitching)
    return {
        "model": "SCAPE" if body.one_part_per_face else "BlendSCAPE",
        **_common(body, "f8"),
        "shapedirs": packed(body.shapedirs, "f4"),
        "posedirs": packed(body.posedirs, "f4"),
        "near": packed(body.near, "u2"),
        "shares": packed(body.weights.data, "f8"),
        "carriers": packed(body.weights.indices, "u2"),
        "ends": packed(body.weights.indptr[1:], "u4"),
        "root_row": packed(body.J_regressor[[0]].toarray(), "f8"),
        "factor": packed(factor, "f8"),
        "order": packed(order, "u4"),
    }


def _common(body: SkinnedBody | TriangleBody, kind: str) -> dict[str, Any]:
    """What every body has."""
    return {
        "joint_names": list(body.joint_names),
        "parents": list(body.parents),
        "template": packed(body.template, kind),
        "faces": packed(body.faces, "u4"),
    }


def _bulge(body: SkinnedBody, joint: int) -> dict[str, Any]:
    """A joint's blend shapes, for the vertices that they move."""
    shapes = body.posedirs[:, :, 9 * (joint - 1) : 9 * joint]
    vertices = np.flatnonzero(shapes.any(axis=(1, 2)))
    return {
        "joint": joint,
        "vertices": packed(vertices, "u2"),
        "shapes": packed(shapes[vertices], "f4"),
    }
