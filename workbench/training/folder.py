"""A folder of registrations, with a table of their subjects.

    registrations.csv    file,subject[,gender][,set]
    walk_001.ply         a mesh (.obj, .ply, .off, .glb) in metres, vertices in one order
    jump.npz             vertices (N, 3) m, and optionally faces (F, 3) and confidence (N,), which
                         is from 0 to 1; `seen` is its former name
    many.npy#17          row 17 of a stack (J, N, 3) m, which is read a few at a time

`gender` is female, male or neutral; `set` is poses (some people, many poses each) or shapes (many
people, about one pose). Other columns are refused; other arrays of an .npz are not read.
All files are checked before any work begins.

`read_meshes` reads meshes in motion, for `rig`, from the same files: a folder, with a table or
without one, a stack, or one file for each frame.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.catalogue import load_skinned
from workbench.environment import expanded
from workbench.errors import BadFile, WorkbenchError, listed, shown, some
from workbench.geometry.meshes import (
    MESH_READERS,
    UNSHARED,
    WITH_VERTEX_ORDER,
    read_registered,
    same_faces,
)
from workbench.geometry.solids import volume
from workbench.reading.arrays import (
    any_reals,
    mapped_array,
    open_arrays,
    optional,
    read_expected,
    taken_for,
    wholes,
    widened,
)
from workbench.reading.facts import bounded
from workbench.training.registrations import FARTHEST, Batch

TABLE = "registrations.csv"
GENDERS, SETS = ("female", "male", "neutral"), ("poses", "shapes")
LARGEST_SIZE, SMALLEST_SIZE = 10.0, 0.02  # m across: larger or smaller bodies are in another unit
MOST_UNLIKE = 3.0  # how many times larger or smaller than most others a mesh may be
COLUMNS = ("file", "subject", "gender", "set")
SUFFIXES = (*MESH_READERS, ".npz", ".npy")  # an .stl is refused when it is read, and told why
MOST_LISTED = 10  # bad files in one message
ARRAYS = {
    "vertices": any_reals("N", 3),
    "faces": optional(wholes("F", 3)),
    "confidence": optional(any_reals("N")),
    "seen": optional(any_reals("N")),
}
UNNAMED_SUBJECT = "one"  # what the subject of files without a table is called
LONGEST_NAME = 300  # letters of a file's or a subject's name: file systems take 255


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        file: the name of the mesh's file, with `#` and a row for a stack.
        subject: the name of the person.
        gender: one of `GENDERS`.
        set: one of `SETS`.
    """

    file: str
    subject: str
    gender: str = "neutral"
    set: str = "poses"


@dataclass(frozen=True, eq=False)
class FolderRegistrations:
    """The registrations of a folder, which are read when they are needed.

    Attributes:
        folder: where the files are.
        rows: the lines of the table.
        n_vertices: the number of vertices of each mesh.
        faces: (F, 3) those of the topology, which meshes with faces are compared with.
    """

    folder: Path
    rows: tuple[Row, ...]
    n_vertices: int
    faces: Index

    @cached_property
    def subjects(self) -> tuple[str, ...]:
        """The names of the subjects, in the order of their first rows."""
        return tuple(dict.fromkeys(row.subject for row in self.rows))

    @cached_property
    def subject(self) -> Index:
        """The number of each registration's subject, (J,)."""
        number = {name: s for s, name in enumerate(self.subjects)}
        return np.array([number[row.subject] for row in self.rows], dtype=np.int64)

    def only(self, set: str, gender: str | None = None) -> "FolderRegistrations":
        """The registrations of one set and, if given, of one gender."""
        rows = (r for r in self.rows if r.set == set and gender in (None, r.gender))
        return FolderRegistrations(self.folder, tuple(rows), self.n_vertices, self.faces)

    def read(self, some: slice) -> Batch:
        """The registrations of these rows, read from their files. Raises BadFile."""
        vertices, confidence = zip(*(self.read_row(row) for row in self.rows[some]), strict=True)
        return Batch(some, self.subject[some], np.stack(vertices), np.stack(confidence))

    def read_row(self, row: Row) -> tuple[Array, Array]:
        """The vertices (N, 3) m of a row, and their confidence (N,)."""
        N, (vertices, faces, confidence) = self.n_vertices, _read_mesh(self.folder, row.file)
        if vertices.shape != (N, 3):
            raise BadFile(
                f"{row.file} has vertices of shape {vertices.shape}, but the topology has ({N}, 3)"
            )
        if not np.isfinite(vertices).all():
            bad = int(np.argmax(~np.isfinite(vertices).all(axis=1)))
            raise BadFile(
                f"{row.file}: vertex {bad} is {vertices[bad].tolist()}; repair it, or give it any "
                "place and confidence 0 in an .npz"
            )
        if (far := float(abs(vertices).max())) > FARTHEST:
            raise BadFile(f"{row.file} reaches {far:.3g} m far; metres are expected")
        if confidence is not None:
            within = (confidence >= 0) & (confidence <= 1)
            if confidence.shape != (N,) or not within.all() or not confidence.any():
                raise BadFile(
                    f"{row.file}: confidence must be ({N},) numbers from 0 to 1, not all zero"
                )
        if faces is not None and not same_faces(faces, self.faces):
            raise BadFile(
                f"{row.file} connects its vertices otherwise than the topology: another mesh, or "
                "vertices in another order"
            )
        return vertices, np.ones(N) if confidence is None else confidence


def open_folder(folder: Path, n_vertices: int, faces: Index) -> FolderRegistrations:
    """Open a folder of registrations and check every one of them.

    Raises BadFile that names what cannot be used and why: another topology, numbers that are not
    finite, a mirrored mesh, another unit than metres.
    """
    registrations = FolderRegistrations(folder, read_table(folder / TABLE), n_vertices, faces)
    check_every_file(registrations, faces, str(folder))
    return registrations


def check_every_file(registrations: FolderRegistrations, faces: Index, place: str) -> None:
    """Read every registration in a place. Raises BadFile that names all that cannot be used."""
    rows = registrations.rows
    bad, mirrored = list[str](), list[str]()
    sizes: dict[str, float] = {}
    for row in rows:
        try:
            vertices, confidence = registrations.read_row(row)
        except (WorkbenchError, OSError, ValueError) as error:
            bad.append(str(error))
            continue
        sizes[row.file] = float(np.linalg.norm(np.ptp(vertices[confidence > 0], axis=0)))
        if volume(vertices, faces) < 0:
            mirrored.append(
                f"{row.file} is mirrored: its faces look inwards; turn the sign of one coordinate "
                "back"
            )
    ordinary = float(np.median([*sizes.values()])) if sizes else 1.0
    for file, size in sizes.items():
        if not SMALLEST_SIZE <= size <= LARGEST_SIZE:
            bad.append(
                f"{file} is {size:.3g} m across; metres are expected (millimetres look 1000 "
                "times, centimetres 100 times too large)"
            )
        elif not 1 / MOST_UNLIKE < size / ordinary < MOST_UNLIKE:
            bad.append(f"{file} is {size:.3g} m across, most are {ordinary:.3g} m: another unit?")
    bad += mirrored
    if bad:
        more = f"\nand {len(bad) - MOST_LISTED} more" if len(bad) > MOST_LISTED else ""
        first = "\n".join(f"  {text}" for text in bad[:MOST_LISTED])
        raise BadFile(
            f"{len(bad)} of {len(rows)} registrations in {place} cannot be used:\n{first}{more}"
        )


def read_table(path: Path, suffixes: Collection[str] = SUFFIXES) -> tuple[Row, ...]:
    """Read the subject table of files with certain suffixes, by default those of registrations.

    Raises BadFile, which names the line that cannot be read.
    """
    try:
        text = io.StringIO(bounded(path).decode("utf-8-sig"), newline="")
        reader = csv.DictReader(text)
        lines = list(reader)
        columns = tuple(reader.fieldnames or ())
    except (OSError, BadFile, UnicodeDecodeError, csv.Error) as error:
        raise BadFile(
            f"cannot read the subject table {path} ({error}); it is a .csv with the columns file "
            "and subject, and maybe gender and set"
        ) from error
    for name in ("file", "subject"):
        if name not in columns:
            raise BadFile(f"{path} has no column {name!r}; it has {some(columns)}")
    if len(set(columns)) < len(columns):
        raise BadFile(f"{path} has two columns of one name; it has {some(columns)}")
    if others := [name for name in columns if name not in COLUMNS]:
        raise BadFile(
            f"{path} has columns that are not read: {some(others)}; there are {listed(COLUMNS)}, "
            "so rename them or take them out"
        )
    rows = tuple(_row(path, number, line, suffixes) for number, line in enumerate(lines, start=2))
    if not rows:
        raise BadFile(f"{path} names no registrations")
    for name, times in Counter(row.file for row in rows).items():
        if times > 1:
            raise BadFile(f"{path} names {name} {times} times")
    return rows


def _row(path: Path, number: int, line: dict[str, str | None], suffixes: Collection[str]) -> Row:
    where = f"{path}, line {number}"
    if None in line:
        raise BadFile(f"{where} has more cells than the table has columns")
    required = {k: (v or "").strip() for k, v in line.items() if k in ("file", "subject")}
    if not all(required.values()):
        raise BadFile(f"{where}: file and subject must not be empty")
    for name, text in required.items():
        if len(text) > LONGEST_NAME:
            raise BadFile(f"{where}: {name} has over {LONGEST_NAME} letters: {shown(text)}")
    row = Row(**required)
    for name, known in (("gender", GENDERS), ("set", SETS)):
        value = (line.get(name) or "").strip().lower() or getattr(row, name)
        if value not in known:
            raise BadFile(f"{where}: no {name} is called {shown(value)}; {listed(known)}")
        row = replace(row, **{name: value})
    suffix = Path(row.file.partition("#")[0]).suffix.lower()
    if suffix not in suffixes:
        raise BadFile(f"{where}: {row.file} is none of {listed(set(suffixes) - set(UNSHARED))}")
    return row


def _read_mesh(folder: Path, file: str) -> tuple[Array, Index | None, Array | None]:
    """Vertices, faces and confidence of a file, None for what it does not say; of a stack one row
    is read.
    """
    name, _, number = file.partition("#")
    path = folder / name
    suffix = path.suffix.lower()
    if suffix == ".npy":
        stack = _stack(path)
        if stack.ndim == 3 and number.isdecimal() and int(number) < len(stack):
            stack = stack[int(number)]
        elif stack.ndim != 2 or number:
            raise BadFile(
                f"{path} has the shape {stack.shape}; name one of its rows, as in {path.name}#0"
            )
        return widened(np.array(stack)), None, None
    if suffix == ".npz":
        with (
            taken_for(file, "registration", "repair it, or leave it out of the table"),
            open_arrays(path) as archive,
        ):
            arrays = read_expected(archive, ARRAYS)
        confidence = arrays.get("confidence", arrays.get("seen"))
        return arrays["vertices"], arrays.get("faces"), confidence
    mesh = read_registered(path, points_alone=True)
    return mesh.vertices, mesh.faces if len(mesh.faces) else None, None


def _stack(path: Path) -> Array:
    with taken_for(path, "stack of registrations", "save it as float32 or float64 with np.save"):
        stack = mapped_array(path)
        if stack.dtype.kind != "f" or stack.dtype.itemsize not in (4, 8):
            raise BadFile(f"it holds {stack.dtype}, not float32 or float64")
        if stack.ndim not in (2, 3):
            raise BadFile(f"it has the shape {stack.shape}, but must be (T, N, 3)")
    return stack


def read_meshes(
    paths: Sequence[Path], rest: str | Path | None = None
) -> tuple[Array, Index, Array | None]:
    """Meshes (T, N, 3) m of one subject in motion, in the order given, and their faces (F, 3).

    `rest` is the mesh at rest, by its file or a body's name; the third is its vertices (N, 3) m.
    Raises BadFile for files that cannot be used, for meshes of different topologies, of several
    subjects, or with vertices that were not seen, and where no file has faces.
    """
    if not paths:
        raise BadFile("no meshes were given; name a folder, a stack .npy, or one file for a frame")
    place, rows = ", ".join(p.name for p in paths[:3]), [r for p in paths for r in _rows(p)]
    if len(people := {row.subject for row in rows}) > 1:
        raise BadFile(
            f"the meshes are of {len(people)} subjects ({some(tuple(sorted(people)))}), but a rig "
            "is found for one; give the meshes of one, or train a body with `workbench train`"
        )
    at_rest, faces = (None, None) if rest is None else _at_rest(rest)
    first = rows[0].file
    N = len(at_rest if at_rest is not None else _read_mesh(Path(), first)[0])
    if faces is None:
        each = (_read_mesh(Path(), row.file)[1] for row in rows)
        faces = next((own for own in each if own is not None), None)
    if faces is None:
        raise BadFile(
            "none of the files has faces; give a mesh of the same topology that has some, with "
            "--rest"
        )
    registrations = FolderRegistrations(Path(), tuple(rows), N, faces)
    check_every_file(registrations, faces, place)
    meshes = registrations.read(slice(0, len(rows)))
    if (meshes.confidence < 1).any():
        bad = int((meshes.confidence < 1).any(axis=1).argmax())
        raise BadFile(
            f"{rows[bad].file} has vertices of confidence below 1; a rig needs every vertex of "
            "every mesh, so leave such meshes out, or complete them"
        )
    return meshes.vertices, faces, at_rest


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
    if path.suffix.lower() == ".npy" and (stack := _stack(path)).ndim == 3:
        return [Row(f"{path}#{i}", UNNAMED_SUBJECT) for i in range(len(stack))]
    return [Row(str(path), UNNAMED_SUBJECT)]


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
