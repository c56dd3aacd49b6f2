"""The weights of the finer rig, 24 joints and 8 half limbs: what the synthetic teacher needs.

They are stored beside the bodies, so that whoever wants to learn pose blend shapes has a teacher to
learn them from, without the wheel.
"""

from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.errors import BadFile
from workbench.reading.archive import open_arrays
from workbench.reading.damage import taken_for
from workbench.reading.expected import check_numbers, read_expected, wholes
from workbench.training.embedded.base_mesh import read_base_mesh
from workbench.training.embedded.packing import SHARES
from workbench.training.embedded.rig import N_FINE, at_most_four, coarse, read_rig
from workbench.training.embedded.skeleton import N_JOINTS, PARENTS
from workbench.training.embedded.teacher import Teacher
from workbench.training.embedded.topology import read_topology
from workbench.training.embedded.wheel import Wheel
from workbench.writing import replacing

Array = NDArray[np.float64]

FILE_NAME = "fine_weights.npz"
BODIES = ("default", "small")


def write_fine_weights(wheel: Wheel, folder: Path) -> Path:
    """`fine_weights.npz`: per body the shares (N, 32) of 32,768, only those that are not zero."""
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    arrays: dict[str, Any] = {}
    for name in BODIES:
        weights = read_topology(wheel, name, mesh).follows @ rig.fine_weights
        shares = np.rint(weights * SHARES).astype(np.int64)
        shares[np.arange(len(shares)), shares.argmax(axis=1)] += SHARES - shares.sum(axis=1)
        rows, columns = np.nonzero(shares)
        arrays |= {
            f"{name}_rows": rows.astype(np.uint16),
            f"{name}_columns": columns.astype(np.uint8),
            f"{name}_shares": shares[rows, columns].astype(np.uint16),
        }
    path = folder / FILE_NAME
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    return path


def teacher_of(body: SkinnedBody) -> Teacher:
    """The synthetic teacher of an embedded body's mean person.

    Raises BadFile for a body whose fine weights are not shipped.
    """
    if body.name not in BODIES or body.parents != PARENTS or body.n_joints != N_JOINTS:
        raise BadFile(
            f"there is no teacher for body {body.name!r}; there is one for {' and '.join(BODIES)}, "
            "as load_body gives them"
        )
    parts, N = [f"{body.name}_{part}" for part in ("shares", "rows", "columns")], body.n_vertices
    with (
        as_file(files("workbench") / "data" / "bodies" / FILE_NAME) as path,
        taken_for(path, "file of fine weights", "install the workbench again"),
        open_arrays(path) as archive,
    ):
        arrays = read_expected(archive, dict.fromkeys(parts, wholes("entries")))
        shares, rows, columns = (arrays[part] for part in parts)
        check_numbers(parts[1], rows, N)
        check_numbers(parts[2], columns, N_FINE)
    weights = csr_array((shares / SHARES, (rows, columns)), shape=(N, N_FINE))
    return Teacher(body.template, body.J_regressor @ body.template, weights)


def pupil_of(body: SkinnedBody) -> SkinnedBody:
    """An embedded body on the teacher's rig, its half limbs together, without pose blend shapes.

    A trained body's own weights count on its blend shapes, and its poses are not the teacher's.
    Raises BadFile as `teacher_of` does.
    """
    weights = coarse(teacher_of(body).weights.toarray())
    assert body.mirror is not None  # embedded bodies are alike on both sides
    carried = replace(body, weights=at_most_four(weights, body.mirror))
    return without_pose_blend_shapes(carried)
