"""Which of the arrays in an .npz file are the points of a scan, and which belong to these."""

from collections.abc import Callable
from typing import NamedTuple

from workbench.arrays import Array, Index
from workbench.errors import BadFile, some
from workbench.reading.arrays import Archive, Header, widened

POINTS = ("points", "vertices", "xyz", "positions", "scan")
NORMALS, FACES = ("normals", "vertex_normals"), ("faces", "triangles")
CAMERA = ("camera_position", "camera_center")
OTHERS = ("colors", "colours", "rgb", "directions")  # of the form of points, and none


class ChosenArrays(NamedTuple):
    """The arrays of one scan, as `Contents` holds them."""

    points: Array
    normals: Array | None
    faces: Index | None
    camera_position: Array | None
    notes: tuple[str, ...]


def chosen_arrays(archive: Archive, name: str | None) -> ChosenArrays:
    """The points that are called `name`, or the only ones, with what belongs to them.

    Raises BadFile with the reason alone, which lists the names if there are several.
    """
    headers = archive.headers
    name = _points(headers_of_points(archive), archive, name)
    N = headers[name].shape[0]
    normals = _first(archive, (f"{name}_normals", *NORMALS), _is_of_points, N)
    faces = _first(archive, (f"{name}_faces", *FACES), _is_of_faces, None)
    camera = _first(archive, CAMERA, _is_of_camera, None)
    read = {name, normals, faces, camera}
    unread = sorted(headers.keys() - read) + list(archive.others)
    return ChosenArrays(
        widened(archive.array(name)),
        None if normals is None else widened(archive.array(normals)),
        None if faces is None else archive.array(faces).astype("i8"),
        None if camera is None else widened(archive.array(camera)).reshape(3),
        (f"not read are the arrays {some(unread)}",) if unread else (),
    )


def headers_of_points(archive: Archive) -> tuple[str, ...]:
    """The names of all arrays that have the form of points and no name that speaks against it."""
    taken = {*NORMALS, *FACES, *OTHERS}
    return tuple(
        name
        for name, header in archive.headers.items()
        if _is_of_points(header, None) and name not in taken and not name.endswith("_normals")
    )


def _points(candidates: tuple[str, ...], archive: Archive, name: str | None) -> str:
    if name is not None:
        if name not in archive.headers:
            raise BadFile(f"it has no array {name!r}; arrays of points are {some(candidates)}")
        if not _is_of_points(archive.headers[name], None):
            header = archive.headers[name]
            raise BadFile(f"{name} is {header.dtype} of shape {header.shape}, not points (N, 3)")
        return name
    known = [one for one in POINTS if one in candidates]
    if len(known) == 1 or len(candidates) == 1:
        return (known or list(candidates))[0]
    if not candidates:
        raise BadFile(f"no array has the shape (N, 3) of points; it holds {some(archive.headers)}")
    raise BadFile(f"several of its arrays may be the points; name one of {some(candidates)}")


def _first(
    archive: Archive,
    names: tuple[str, ...],
    fits: Callable[[Header, int | None], bool],
    length: int | None,
) -> str | None:
    headers = archive.headers
    return next((one for one in names if one in headers and fits(headers[one], length)), None)


def _is_of_points(header: Header, length: int | None) -> bool:
    rows = header.shape[0] if len(header.shape) == 2 and header.shape[1] == 3 else None
    return header.dtype.kind in "iuf" and rows is not None and length in (None, rows)


def _is_of_faces(header: Header, length: int | None) -> bool:
    return header.dtype.kind in "iu" and len(header.shape) == 2 and header.shape[1] == 3


def _is_of_camera(header: Header, length: int | None) -> bool:
    return header.dtype.kind in "iuf" and header.shape in ((3,), (1, 3), (3, 1))
