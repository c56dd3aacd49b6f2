"""Reading the SCAPE and BlendSCAPE bodies that come with the workbench."""

from collections.abc import Callable
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from workbench.bodies.files.embedded import REPAIR, STEPS, embedded
from workbench.bodies.readonly import locked
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.reading.arrays import check_numbers, opened, read_expected, reals, texts, wholes
from workbench.reading.facts import facts_in

EXPECTED = {
    "near": wholes("F", "J"),
    "posedirs": STEPS("F", 3, 3, "T"),
    "posedirs_step": reals(),
    "card": texts(),
}
UNTRAINED: dict[str, tuple[str, Callable[[SkinnedBody], TriangleBody]]] = {
    "small-scape": ("small", scape),
    "small-blend-scape": ("small", blend_scape),
    "default-scape": ("default", scape),
    "default-blend-scape": ("default", blend_scape),
}  # the skinned body whose mesh, tree and shape space each has, and the model that it follows


def embedded_triangles(name: str) -> TriangleBody:
    """One of the bodies in `UNTRAINED`, with its learned posedirs.

    Everything but posedirs is that of the skinned body, written as deformations of triangles.
    """
    with as_file(files("workbench") / "data" / "bodies" / f"{name}.npz") as packed:
        return read_embedded_triangles(packed, *UNTRAINED[name])


def read_embedded_triangles(
    path: Path, mesh: str, model: Callable[[SkinnedBody], TriangleBody]
) -> TriangleBody:
    """A model of the embedded body `mesh` with the posedirs of a file, called like the file.

    Raises BadFile if the file is missing or is not one, BadBody if its arrays do not fit the body.
    """
    skinned = embedded(mesh)
    body = model(skinned)
    with opened(path, "embedded body", REPAIR) as archive:
        arrays = read_expected(archive, EXPECTED)
        card = facts_in(arrays["card"]).entries
        check_numbers("near", arrays["near"], body.n_joints)
    learned = np.asarray(arrays["posedirs"] * float(arrays["posedirs_step"]), dtype=np.float64)
    return replace(
        body,
        posedirs=locked(learned),
        near=arrays["near"],
        name=path.stem,
        card={**card, "skinned_body": dict(skinned.card)},
    )
