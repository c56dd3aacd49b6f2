"""Whether the arrays of a triangle body fit together; if not, which one and why."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from workbench.bodies.files.extras import TRIANGLES, clashes
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.bodies.validation import check_landmarks, check_rows, check_tree
from workbench.errors import BadBody, BadMesh
from workbench.geometry.triangles import gradients


def check(body: TriangleArrays) -> None:
    """Raise BadBody with what is wrong and where, or return."""

    def refuse(reason: str) -> NoReturn:
        raise BadBody(f"body {body.name!r}: {reason}")

    def shape(name: str, expected: tuple[int | str, ...]) -> None:
        found = getattr(body, name).shape
        fits = len(found) == len(expected) and all(
            isinstance(n, str) or n == m for n, m in zip(expected, found, strict=True)
        )
        if not fits:
            refuse(f"{name} has shape {found}, but must be ({', '.join(map(str, expected))})")

    check_tree(refuse, body.parents)
    shape("template", ("N", 3))
    shape("faces", ("F", 3))
    N, F, K = len(body.template), len(body.faces), len(body.parents)
    shape("shapedirs", (F, 3, 3, "B"))
    shape("near", (F, "J"))
    shape("posedirs", (F, 3, 3, 3 * body.near.shape[1]))
    shape("weights", (F, K))
    shape("J_regressor", (K, N))
    if len(body.joint_names) != K:
        refuse(f"joint_names has {len(body.joint_names)} names for {K} joints")
    for name in ("template", "shapedirs", "posedirs"):
        bad = np.argwhere(~np.isfinite(getattr(body, name)))
        if len(bad):
            refuse(f"{name}[{', '.join(map(str, bad[0]))}] is not finite ({len(bad)} such entries)")
    for name in ("weights", "J_regressor"):
        if not np.isfinite(getattr(body, name).data).all():
            refuse(f"{name} holds entries that are not finite")
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
            f"the faces leave {N} vertices in {parts} pieces, and stitching tells nothing of where "
            "one piece is beside another; keep one piece"
        )
    if own := clashes(body.extras, TRIANGLES):
        refuse(f"extras must not be called like the body's own arrays in a file: {', '.join(own)}")
    check_landmarks(refuse, body.landmarks, N)
