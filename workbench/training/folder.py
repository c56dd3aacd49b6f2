"""A folder of a user's own registrations, with a table of whose they are.

    registrations.csv    file,subject[,gender][,set]
    walk_001.ply         a mesh (.obj, .ply, .off, .glb) in metres, vertices in one order
    jump.npz             vertices (N, 3) m, and maybe faces (F, 3) and seen (N,) from 0 to 1
    many.npy#17          row 17 of a stack (J, N, 3) m, which is read a few at a time

`gender` is female, male or neutral; `set` is poses (some people, many poses each) or shapes (many
people, about one pose). Other columns are refused; other arrays of an .npz are not read.
Everything is looked at before any work begins.
"""

import csv
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.npz_files import read_npz
from workbench.errors import BadFile, WorkbenchError, listed
from workbench.geometry.meshes import READERS, REGISTERED, read_registered, same_faces
from workbench.training.mesh_graph import signed_volume
from workbench.training.registrations import Batch

Array = NDArray[np.float64]
Index = NDArray[np.int64]
TABLE = "registrations.csv"
GENDERS, SETS = ("female", "male", "neutral"), ("poses", "shapes")
LARGEST, SMALLEST = 10.0, 0.02  # m across: no body that registers with millimetres is as large
UNLIKE = 3.0  # times as large as most of the others
COLUMNS = ("file", "subject", "gender", "set")
MOST_TOLD = 10  # bad files in one message


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    file: str
    subject: str
    gender: str = "neutral"
    set: str = "poses"


@dataclass(frozen=True, eq=False)
class FolderRegistrations:
    """Rows of the table, read as they are asked for."""

    folder: Path
    rows: tuple[Row, ...]
    n_vertices: int
    faces: Index | None  # of the body that they register, to be compared with the meshes'

    @cached_property
    def subjects(self) -> tuple[str, ...]:
        """The people, in the order in which they come first."""
        return tuple(dict.fromkeys(row.subject for row in self.rows))

    @cached_property
    def subject(self) -> Index:
        """Whose each is, (J,)."""
        number = {name: s for s, name in enumerate(self.subjects)}
        return np.array([number[row.subject] for row in self.rows], dtype=np.int64)

    def only(self, set: str, gender: str | None = None) -> "FolderRegistrations":
        """Those of one set, and of one gender."""
        rows = (r for r in self.rows if r.set == set and gender in (None, r.gender))
        return FolderRegistrations(self.folder, tuple(rows), self.n_vertices, self.faces)

    def read(self, some: slice) -> Batch:
        """From their files; raises BadFile."""
        read = [self.one(row) for row in self.rows[some]]
        vertices = np.stack([v for v, _ in read])
        return Batch(some, self.subject[some], vertices, np.stack([seen for _, seen in read]))

    def one(self, row: Row) -> tuple[Array, Array]:
        """Vertices (N, 3) m and their trust (N,)."""
        name, _, number = row.file.partition("#")
        path = self.folder / name
        suffix = path.suffix.lower()
        seen, faces = np.ones(self.n_vertices), None
        if suffix == ".npy":
            vertices = _from_stack(path, number)
        elif suffix == ".npz":
            arrays = read_npz(path)
            if "vertices" not in arrays:
                raise BadFile(f"{row.file} holds {listed(arrays)}, but no vertices")
            vertices = np.asarray(arrays["vertices"], dtype=np.float64)
            if "faces" in arrays:
                faces = np.asarray(arrays["faces"], dtype=np.int64)
            if "seen" in arrays:
                seen = np.asarray(arrays["seen"], dtype=np.float64)
        else:
            mesh = read_registered(path, points_alone=True)
            vertices, faces = mesh.vertices, mesh.faces if len(mesh.faces) else None
        self._refuse(row, vertices, seen, faces)
        return vertices, seen

    def _refuse(self, row: Row, vertices: Array, seen: Array, faces: Index | None) -> None:
        N = self.n_vertices
        if vertices.shape != (N, 3):
            raise BadFile(
                f"{row.file} has vertices of shape {vertices.shape}, but the topology has ({N}, 3)"
            )
        if not np.isfinite(vertices).all():
            bad = int(np.argmax(~np.isfinite(vertices).all(axis=1)))
            raise BadFile(
                f"{row.file}: vertex {bad} is {vertices[bad].tolist()}; repair it, or give it any "
                "place and seen = 0 in an .npz"
            )
        if seen.shape != (N,) or not ((seen >= 0) & (seen <= 1)).all() or not seen.any():
            raise BadFile(f"{row.file}: seen must be ({N},) numbers from 0 to 1, not all zero")
        if self.faces is None or faces is None:
            return
        if not same_faces(faces, self.faces):
            raise BadFile(
                f"{row.file} connects its vertices otherwise than the topology: another mesh, or "
                "vertices in another order"
            )


def open_folder(folder: Path, n_vertices: int, faces: Index) -> FolderRegistrations:
    """The registrations of a folder, every one of them looked at.

    Raises BadFile that names what cannot be used and why: another topology, numbers that are not
    finite, a mirrored mesh, another unit than metres.
    """
    rows = read_table(folder / TABLE)
    found = FolderRegistrations(folder, rows, n_vertices, faces)
    bad: list[str] = []
    sizes, volumes = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for i, row in enumerate(rows):
        try:
            vertices, seen = found.one(row)
        except (WorkbenchError, OSError, ValueError) as error:
            bad.append(str(error))
            continue
        there = vertices[seen > 0]
        sizes[i] = np.linalg.norm(np.ptp(there, axis=0))
        volumes[i] = signed_volume(vertices, faces)
    bad += list(_out_of_size(rows, sizes)) + list(_mirrored(rows, volumes))
    if bad:
        more = f"\nand {len(bad) - MOST_TOLD} more" if len(bad) > MOST_TOLD else ""
        told = "\n".join(f"  {text}" for text in bad[:MOST_TOLD])
        raise BadFile(
            f"{len(bad)} of {len(rows)} registrations in {folder} cannot be used:\n{told}{more}"
        )
    return found


def _out_of_size(rows: tuple[Row, ...], sizes: Array) -> Iterator[str]:
    ordinary = float(np.nanmedian(sizes)) if np.isfinite(sizes).any() else 1.0
    for row, size in zip(rows, sizes, strict=True):
        if size > LARGEST or size < SMALLEST:
            yield (
                f"{row.file} is {size:.3g} m across; metres are expected (millimetres look 1000 "
                "times, centimetres 100 times too large)"
            )
        elif not np.isnan(size) and not 1 / UNLIKE < size / ordinary < UNLIKE:
            yield f"{row.file} is {size:.3g} m across, most are {ordinary:.3g} m: another unit?"


def _mirrored(rows: tuple[Row, ...], volumes: Array) -> Iterator[str]:
    for row, volume in zip(rows, volumes, strict=True):
        if volume < 0:
            yield (
                f"{row.file} is mirrored: its faces look inwards; turn the sign of one coordinate "
                "back"
            )


def read_table(path: Path) -> tuple[Row, ...]:
    """The subject table. Raises BadFile with the line that cannot be read."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            lines = list(reader)
            columns = tuple(reader.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadFile(
            f"cannot read the subject table {path} ({error}); it is a .csv with the columns file "
            "and subject, and maybe gender and set"
        ) from error
    for name in ("file", "subject"):
        if name not in columns:
            raise BadFile(f"{path} has no column {name!r}; it has {listed(columns)}")
    if others := [name for name in columns if name not in COLUMNS]:
        raise BadFile(
            f"{path} has columns that are not read: {listed(others)}; there are {listed(COLUMNS)}, "
            "so rename them or take them out"
        )
    rows = tuple(_row(path, number, line) for number, line in enumerate(lines, start=2))
    if not rows:
        raise BadFile(f"{path} names no registrations")
    for name, times in Counter(row.file for row in rows).items():
        if times > 1:
            raise BadFile(f"{path} names {name} {times} times")
    return rows


def _row(path: Path, number: int, line: dict[str, str | None]) -> Row:
    if None in line:
        raise BadFile(f"{path}, line {number} has more cells than the table has columns")
    said = {k: (v or "").strip() for k, v in line.items() if k in ("file", "subject")}
    if not all(said.values()):
        raise BadFile(f"{path}, line {number}: file and subject must not be empty")
    row = Row(**said)
    for name, known in (("gender", GENDERS), ("set", SETS)):
        value = (line.get(name) or "").strip().lower() or getattr(row, name)
        if value not in known:
            raise BadFile(f"{path}, line {number}: no {name} is called {value!r}; {listed(known)}")
        row = replace(row, **{name: value})
    suffix = Path(row.file.partition("#")[0]).suffix.lower()
    if suffix not in (*READERS, ".npz", ".npy"):
        raise BadFile(
            f"{path}, line {number}: {row.file} is none of {listed((*REGISTERED, '.npz', '.npy'))}"
        )
    return row


def _from_stack(path: Path, number: str) -> Array:
    try:
        stack = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise BadFile(f"cannot read {path}: {error}") from error
    if stack.ndim == 2 and not number:
        return np.array(stack, dtype=np.float64)
    if stack.ndim != 3 or not number.isdecimal() or int(number) >= len(stack):
        raise BadFile(
            f"{path} has the shape {stack.shape}; name one of its rows, as in {path.name}#0"
        )
    return np.array(stack[int(number)], dtype=np.float64)
