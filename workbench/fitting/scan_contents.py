"""What the file of a scan holds, format by format, before anything is guessed or left out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, Index
from workbench.errors import BadArgument, BadFile, listed, some
from workbench.fitting.scan_arrays import chosen_arrays
from workbench.geometry.gltf import parse_glb
from workbench.geometry.meshes import READERS as MESHES
from workbench.geometry.meshes import parse_ply_and_normals, parsed_mesh
from workbench.geometry.point_clouds import parse_pcd, parse_xyz
from workbench.reading.arrays import mapped_array, opened, taken_for, widened

MOST_BYTES = 2**31  # of a file that is read as a whole
UNIT = 0.05  # how far the length of a normal may be from one, for columns that nothing names


@dataclass(frozen=True, eq=False)
class Contents:
    """What a file of a scan holds, in the file's own unit and axes; numbers may be NaN.

    Attributes:
        points: (N, 3).
        normals: (N, 3) of any length, or None.
        faces: (F, 3) numbers of points, which may not exist, or None.
        camera_position: (3,), or None.
        notes: sentences on what was left in the file.
    """

    points: Array
    normals: Array | None = None
    faces: Index | None = None
    camera_position: Array | None = None
    notes: tuple[str, ...] = ()


def contents_of(path: Path, name: str | None = None) -> Contents:
    """Read a file as its suffix says; `name` is the array of points in an .npz file.

    Raises BadFile with a sentence, or BadArgument for a name of what has no names.
    """
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise BadFile(
            f"{path}: no format of scans is called {path.suffix!r}; there are {listed(READERS)}"
        )
    if name is not None and suffix != ".npz":
        raise BadArgument(f"{path} has no arrays with names, so that none is called {name!r}")
    try:
        if path.is_file() and path.stat().st_size > MOST_BYTES and suffix not in ARRAYS:
            raise BadFile(
                f"{path} has {path.stat().st_size / 2**30:.1f} GB, and at most 2 GB are read; "
                "give fewer points, or an .npy file"
            )
    except OSError as error:
        raise BadFile(f"cannot read {path}: {error.strerror}") from error
    return READERS[suffix](path, name)


def _parser(parse: Callable[[bytes], Contents]) -> "Reader":
    return lambda path, name: parsed_mesh(path, parse)


def _mesh(content: bytes, parse: Callable[[bytes], tuple[Array, Index]]) -> Contents:
    points, faces = parse(content)
    return Contents(points, faces=faces)


def _ply(content: bytes) -> Contents:
    points, faces, normals = parse_ply_and_normals(content)
    return Contents(points, normals, faces)


def _pcd(content: bytes) -> Contents:
    found = parse_pcd(content)
    notes: tuple[str, ...] = ()
    if found.unread:
        notes = (f"not read are the fields {some(found.unread)}",)
    if found.viewpoint is None:
        notes += (
            "the file names no viewpoint, or 0 0 0, which programs write that do not know it; if "
            "the points were seen from there, give the camera's position 0 0 0",
        )
    return Contents(found.points, found.normals, None, found.viewpoint, notes)


def _text(content: bytes) -> Contents:
    return _of_columns(*parse_xyz(content))


def _of_columns(numbers: NDArray[Any], columns: int) -> Contents:
    """Points, and normals if there are six columns and the last three are of unit length."""
    points, further = widened(numbers[:, :3]), widened(numbers[:, 3:6])
    with np.errstate(all="ignore"):
        units = np.abs(np.linalg.norm(further, axis=1) - 1) < UNIT
    are_normals = further.shape[1] == 3 and units.mean() > 0.5
    read = 6 if are_normals else 3
    notes: tuple[str, ...] = ()
    if are_normals:
        notes = ("columns 4 to 6 have length one and are taken for normals",)
    if columns > read:
        one = columns == read + 1
        which = f"column {columns} is" if one else f"columns {read + 1} to {columns} are"
        notes += (f"{which} not read",)
    return Contents(points, further if are_normals else None, notes=notes)


def _npy(path: Path, name: str | None) -> Contents:
    with taken_for(path, "scan", "give an array (N, 3) of points as numpy.save writes it"):
        array = mapped_array(path)
        if array.dtype.kind not in "iuf" or array.ndim < 2:
            raise BadFile(f"it holds {array.dtype} of shape {array.shape}, not points (N, 3)")
        rows = array.reshape(-1, array.shape[-1]) if array.shape[-1] == 3 else array
        if rows.ndim != 2 or rows.shape[1] < 3:
            raise BadFile(f"it holds an array of shape {array.shape}, not points (N, 3)")
        return _of_columns(rows[:, :6], rows.shape[1])


def _npz(path: Path, name: str | None) -> Contents:
    do = "give an .npz file with an array (N, 3) called points, as numpy.savez writes it"
    with opened(path, "scan", do) as archive:
        return Contents(*chosen_arrays(archive, name))


Reader = Callable[[Path, str | None], Contents]
ARRAYS = (".npz", ".npy")  # which are checked before anything is read
READERS: dict[str, Reader] = {
    ".ply": _parser(_ply),
    ".obj": _parser(lambda content: _mesh(content, MESHES[".obj"])),
    ".off": _parser(lambda content: _mesh(content, MESHES[".off"])),
    ".pcd": _parser(_pcd),
    ".stl": _parser(lambda content: _mesh(content, MESHES[".stl"])),
    ".glb": _parser(lambda content: _mesh(content, parse_glb)),
    ".npz": _npz,
    ".npy": _npy,
    ".xyz": _parser(_text),
    ".txt": _parser(_text),
    ".csv": _parser(_text),
}
