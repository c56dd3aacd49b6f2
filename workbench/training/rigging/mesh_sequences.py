"""Meshes in motion from files: a folder, a stack in one file, or one file for each frame.

The files are those of registrations (see `training.folder`): meshes (.obj, .ply, .off, .glb), .npz
with `vertices` and maybe `faces`, and stacks (T, N, 3) m in an .npy. A folder with a table
registrations.csv holds the meshes that the table names, in its order; of a folder without one, all
files that can be read are taken, in the order of their names.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.catalogue import load_skinned
from workbench.environment import expanded
from workbench.errors import BadFile, listed, some
from workbench.geometry.meshes import WITH_VERTEX_ORDER, read_registered
from workbench.reading.arrays import (
    any_reals,
    mapped_array,
    opened,
    optional,
    read_expected,
    taken_for,
    wholes,
)
from workbench.training.folder import (
    SUFFIXES,
    TABLE,
    FolderRegistrations,
    Row,
    check_registrations,
    read_table,
)

SUBJECT = "one"  # what the subject of files without a table is called


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """Meshes of one subject in motion.

    Attributes:
        meshes: (T, N, 3) in metres.
        faces: (F, 3) their triangles.
        rest: (N, 3) in metres, the mesh at rest; None if none was given.
    """

    meshes: Array
    faces: Index
    rest: Array | None


def read_meshes(paths: Sequence[Path], rest: str | Path | None = None) -> MeshSequence:
    """Read meshes in the order given; `rest` is the mesh at rest, by its file or a body's name.

    Raises BadFile for files that cannot be used, for meshes of different topologies, of several
    subjects, or with vertices that were not seen, and where no file has faces.
    """
    if not paths:
        raise BadFile("no meshes were given; name a folder, a stack .npy, or one file for a frame")
    place, rows = ", ".join(p.name for p in paths[:3]), [r for p in paths for r in _rows(p)]
    if len(who := {row.subject for row in rows}) > 1:
        raise BadFile(
            f"the meshes are of {len(who)} subjects ({some(tuple(sorted(who)))}), but a rig is "
            "found for one; give the meshes of one, or train a body with `workbench train`"
        )
    own, faces = (None, None) if rest is None else _at_rest(rest)
    if faces is None:
        faces = _faces(rows)
    first = FolderRegistrations(Path(), tuple(rows[:1]), 0, None)
    N = len(own) if own is not None else _count(first.folder / rows[0].file)
    found = FolderRegistrations(Path(), tuple(rows), N, faces)
    check_registrations(found, faces, place)
    batch = found.read(slice(0, len(rows)))
    if (batch.confidence < 1).any():
        bad = int((batch.confidence < 1).any(axis=1).argmax())
        raise BadFile(
            f"{rows[bad].file} has vertices of confidence below 1; a rig needs every vertex of "
            "every mesh, so leave such meshes out, or complete them"
        )
    return MeshSequence(batch.vertices, faces, own)


def _rows(path: Path) -> list[Row]:
    """The meshes that one argument names, with whole paths."""
    path = expanded(path)
    if path.is_dir():
        if (path / TABLE).is_file():
            return [Row(str(path / row.file), row.subject) for row in read_table(path / TABLE)]
        inside = sorted((p for p in path.iterdir() if p.suffix.lower() in SUFFIXES), key=_numbered)
        if not inside:
            raise BadFile(f"{path} has no meshes; there can be {listed(SUFFIXES)}")
        return [row for p in inside for row in _rows(p)]
    if not path.is_file():
        raise BadFile(f"there is no file or folder {path}")
    if path.suffix.lower() not in SUFFIXES:
        raise BadFile(f"{path} is none of {listed(SUFFIXES)}")
    if path.suffix.lower() == ".npy":
        with taken_for(path, "stack of meshes", "save it as float32 or float64 with np.save"):
            stack = mapped_array(path)
            if stack.ndim not in (2, 3):
                raise BadFile(f"it has the shape {stack.shape}, but must be (T, N, 3)")
        if stack.ndim == 3:
            return [Row(f"{path}#{i}", SUBJECT) for i in range(len(stack))]
    return [Row(str(path), SUBJECT)]


def _numbered(path: Path) -> list[tuple[int, str]]:
    """Sorts mesh_2 before mesh_10."""
    parts = re.split(r"([0-9]+)", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _at_rest(rest: str | Path) -> tuple[Array, Index]:
    path = expanded(rest)
    if path.suffix.lower() in WITH_VERTEX_ORDER:
        mesh = read_registered(path)
        return mesh.vertices, mesh.faces
    body = load_skinned(rest)
    return body.template, body.faces


def _faces(rows: Sequence[Row]) -> Index:
    """The faces of the first file that has some."""
    for row in rows:
        path = Path(row.file.partition("#")[0])
        suffix = path.suffix.lower()
        if suffix == ".npy":
            continue
        if suffix == ".npz":
            with opened(path, "mesh", "give an .npz with vertices and faces") as archive:
                faces = read_expected(archive, {"faces": optional(wholes("F", 3))}).get("faces")
        else:
            faces = read_registered(path, points_alone=True).faces
        if faces is not None and len(faces):
            return np.asarray(faces, dtype=np.int64)
    raise BadFile(
        "none of the files has faces; give a mesh of the same topology that has some, with --rest"
    )


def _count(path: Path) -> int:
    """The number of vertices of a mesh."""
    path = Path(str(path).partition("#")[0])
    if path.suffix.lower() == ".npy":
        with taken_for(path, "stack of meshes", "save it with np.save"):
            shape = mapped_array(path).shape
        return int(shape[-2])
    if path.suffix.lower() == ".npz":
        with opened(path, "mesh", "give an .npz with vertices (N, 3)") as archive:
            return len(read_expected(archive, {"vertices": any_reals("N", 3)})["vertices"])
    return len(read_registered(path, points_alone=True).vertices)
