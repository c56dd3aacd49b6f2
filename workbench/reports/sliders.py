"""A body as one page in which theta and beta can be moved, computed in the browser."""

from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.skinned_only import not_skinned
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.geometry.stitching import banded_factor
from workbench.reports.page import page
from workbench.writing import replacing

MOST_WEIGHTS = 4  # per vertex, as in SMPL
MOST_STITCHED = 2_000  # vertices: beyond, the factor of the stitching makes the page too large
NOTE = (
    "This page computes what the workbench computes, in double precision; only {single} stored in "
    "single precision. A test compares its vertices in a browser with those of Python: they differ "
    "by less than {millimetres} mm. The page's address keeps the settings, so that a link to it "
    "shows the same body."
)


@dataclass(frozen=True)
class Part:
    """A switch of the page.

    Attributes:
        id: what the page's program calls the part.
        label: what the reader sees.
        on: whether it is on at first; the whole model has all parts in this state.
    """

    id: str
    label: str
    on: bool = True


SKINNED = (
    Part("weights", "blend weights"),
    Part("pose_shapes", "pose blend shapes"),
    Part("shape_shapes", "shape blend shapes"),
    Part("dual", "dual quaternions instead of linear blending", on=False),
)
STITCHED = (
    Part("pose_shapes", "Q, what the pose does to each triangle"),
    Part("shape_shapes", "D, what the shape does to each triangle"),
    Part("stitched", "stitching; without it, each triangle is deformed about its own centre"),
)
BLENDED = Part("weights", "blending of the parts' rotations, of which each triangle has several")


def write_sliders(body: SkinnedBody | TriangleBody, path: str | Path) -> Path:
    """Write the page of a body. Raises BadArgument for one that it cannot show, and BadFile."""
    text, path = sliders_page(body), Path(path)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def sliders_page(body: SkinnedBody | TriangleBody) -> str:
    """The page of a body as HTML. Raises BadArgument for a body that it cannot show."""
    if isinstance(body, TriangleBody):
        data, script = triangle_data(body), "scape.js"
        single, millimetres = "the deformations of triangles are", "0.00005"
        parts = STITCHED if data["model"] == "SCAPE" else (BLENDED, *STITCHED)
    else:
        data, script = skinned_data(body), "smpl.js"
        single, millimetres = "the pose blend shapes are", "0.00001"
        parts = SKINNED
    return page(
        "sliders.html",
        title=f"Moving theta and beta: {body.name}",
        data=data,
        parts=parts,
        script=script,
        note=NOTE.format(single=single, millimetres=millimetres),
    )


def skinned_data(body: SkinnedBody) -> dict[str, Any]:
    """The arrays for smpl.js, in base64: little-endian, row by row.

    Raises BadArgument for a body that is not SMPL's, is not bound in the pose zero, has free arrays
    or more than four weights in a vertex, or more than 65,536 vertices.
    """
    if other := not_skinned(body, "the page of sliders", "body.vertices(pose) moves it"):
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
        **_common(body),
        "shapedirs": _text(body.shapedirs.transpose(2, 0, 1), "<f8"),
        "joints_mean": _text(skeleton.mean, "<f8"),
        "joints_move": _text(skeleton.slopes.transpose(2, 0, 1), "<f8"),
        "weights": _text(shares, "<f8"),
        "carriers": _text(carriers, "<u2"),
        "bulges": [_bulge(body, k) for k in range(1, body.n_joints)],
    }


def triangle_data(body: TriangleBody) -> dict[str, Any]:
    """The arrays for scape.js, in base64: little-endian, row by row.

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
        **_common(body),
        "shapedirs": _text(body.shapedirs, "<f4"),
        "posedirs": _text(body.posedirs, "<f4"),
        "near": _text(body.near, "<u2"),
        "shares": _text(body.weights.data, "<f8"),
        "carriers": _text(body.weights.indices, "<u2"),
        "ends": _text(body.weights.indptr[1:], "<u4"),
        "root_row": _text(body.J_regressor[[0]].toarray(), "<f8"),
        "factor": _text(factor, "<f8"),
        "order": _text(order, "<u4"),
    }


def _common(body: SkinnedBody | TriangleBody) -> dict[str, Any]:
    """What every body has."""
    return {
        "joint_names": list(body.joint_names),
        "parents": list(body.parents),
        "template": _text(body.template, "<f8"),
        "faces": _text(body.faces, "<u4"),
    }


def _bulge(body: SkinnedBody, joint: int) -> dict[str, Any]:
    """A joint's blend shapes, for the vertices that they move."""
    shapes = body.posedirs[:, :, 9 * (joint - 1) : 9 * joint]
    vertices = np.flatnonzero(shapes.any(axis=(1, 2)))
    return {
        "joint": joint,
        "vertices": _text(vertices, "<u2"),
        "shapes": _text(shapes[vertices], "<f4"),
    }


def _text(array: NDArray[Any], kind: str) -> str:
    return b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode("ascii")
