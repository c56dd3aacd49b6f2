"""Whether the arrays of a triangle body fit together; if they do not, which of them, and why."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from workbench.bodies.files.reading import TRIANGLES, clashes
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.bodies.validation import (
    check_finite,
    check_landmarks,
    check_rows,
    check_shapes,
    check_sizes,
    check_tree,
)
from workbench.errors import BadBody, BadMesh
from workbench.geometry.triangles import gradients


def check(body: TriangleArrays) -> None:
    """Raise BadBody with what is wrong and where, or return."""

    def refuse(reason: str) -> NoReturn:
        raise BadBody(f"body {body.name!r}: {reason}")

    check_tree(refuse, body.parents)
    check_shapes(refuse, {"template": (body.template, ("N", 3)), "faces": (body.faces, ("F", 3))})
    N, F, K = len(body.template), len(body.faces), len(body.parents)
    check_shapes(refuse, {"near": (body.near, (F, "J"))})
    check_shapes(
        refuse,
        {
            "shapedirs": (body.shapedirs, (F, 3, 3, "B")),
            "posedirs": (body.posedirs, (F, 3, 3, 3 * body.near.shape[1])),
            "weights": (body.weights, (F, K)),
            "J_regressor": (body.J_regressor, (K, N)),
        },
    )
    if len(body.joint_names) != K:
        refuse(f"joint_names has {len(body.joint_names)} names for {K} joints")
    check_finite(refuse, body, ("template", "shapedirs", "posedirs", "weights", "J_regressor"))
    check_sizes(refuse, body, ("template",))
    check_rows(refuse, "weights", np.asarray(body.weights.sum(axis=1)), "face")
    check_rows(refuse, "J_regressor", np.asarray(body.J_regressor.sum(axis=1)), "joint")
    outside = (body.near < 1) | (body.near >= K)
    if outside.any():
        face = int(np.argmax(outside.any(axis=1)))
        refuse(
            f"face {face} is near the joints {body.near[face].tolist()}, but joints that bend "
            f"are 1 to {K - 1}"
        )
    twice = np.diff(np.sort(body.near, axis=1), axis=1) == 0
    if twice.any():
        face = int(np.argmax(twice.any(axis=1)))
        refuse(f"face {face} is near the joints {body.near[face].tolist()}: one of them twice")
    try:
        parts = body.stitching.n_components
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # such a face has no area, and is refused
            gradients(body.template, body.template, body.faces)
    except BadMesh as error:
        refuse(str(error))
    if parts != 1:
        refuse(
            f"the faces leave {N} vertices in {parts} pieces, and stitching does not say where one "
            "piece is beside another; keep one piece"
        )
    if own := clashes(body.extras, TRIANGLES):
        refuse(f"extras must not be called like the body's own arrays in a file: {', '.join(own)}")
    check_landmarks(refuse, body.landmarks, N)
