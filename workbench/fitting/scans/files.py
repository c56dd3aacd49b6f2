"""Scans in users' files: formats, guesses with a sentence each, normals that point outwards."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array, Index
from workbench.blocks.checks import reals
from workbench.errors import BadArgument, BadFile, cut, listed, some
from workbench.fitting.scans.cleaning import cleaned, far_points, points_are, without_planes
from workbench.fitting.scans.scan import BadScan, Scan, ScanContents, areas_of_faces
from workbench.fitting.scans.surface import (
    areas_of_neighbours,
    edges_of_one_face,
    filled_normals,
    normals_of_neighbours,
    outline,
    principal_axes,
    towards,
    units,
)
from workbench.geometry.gltf import parse_glb
from workbench.geometry.guesses import PERSON, UNITS, UP_TO_Y, Sizes, extents, unit_of, up_of
from workbench.geometry.meshes import MESH_READERS, Parts, parse_ply_and_normals, parsed_mesh
from workbench.geometry.point_clouds import parse_pcd, parse_xyz
from workbench.geometry.solids import face_vectors, vertex_normals, volume
from workbench.reading.arrays import Header, mapped_array, opened, taken_for, widened

POINTS = ("points", "vertices", "xyz", "positions", "scan")
NORMALS, FACES = ("normals", "vertex_normals"), ("faces", "triangles")
CAMERA = ("camera_position", "camera_center")
NOT_POINTS = ("colors", "colours", "rgb", "directions")  # of the form of points, and none
MOST_BYTES = 2**31  # of a file that is read as a whole
UNIT_TOLERANCE = 0.05  # how far the length of a normal may be from one, in unnamed columns
ARRAY_SUFFIXES = (".npz", ".npy")  # which are checked before anything is read
SMALLEST_LIMIT, USUAL_LIMIT = 1_000, 500_000  # points of a cloud; a fit uses a tenth of them
FEWEST_PLACES = 10  # cells that an outline fills; that of a person fills thousands
DECLARED_BY_FORMAT = {".glb": ("m", "y")}  # by glTF 2.0, section 3.4


def _name_of_points(headers: Mapping[str, Header], name: str | None) -> str:
    """The name of the points, which have their form and no name that speaks against it."""
    other_names = {*NORMALS, *FACES, *NOT_POINTS}
    candidates = [
        key
        for key, header in headers.items()
        if _is_of_points(header) and key not in other_names and not key.endswith("_normals")
    ]
    if name is not None:
        if name not in headers:
            raise BadFile(f"it has no array {name!r}; arrays of points are {some(candidates)}")
        if not _is_of_points(headers[name]):
            header = headers[name]
            raise BadFile(f"{name} is {header.dtype} of shape {header.shape}, not points (N, 3)")
        return name
    known = [key for key in POINTS if key in candidates]
    if len(known) == 1 or len(candidates) == 1:
        return (known or candidates)[0]
    if not candidates:
        raise BadFile(f"no array has the shape (N, 3) of points; it holds {some(headers)}")
    raise BadFile(f"several of its arrays may be the points; name one of {some(candidates)}")


def _is_of_points(header: Header) -> bool:
    return header.dtype.kind in "iuf" and len(header.shape) == 2 and header.shape[1] == 3


def contents_of(path: Path, name: str | None = None) -> ScanContents:
    """Read a file as its suffix says; `name` is the array of points in an .npz file.

    Raises BadFile with a sentence, or BadArgument for a name of what has no names.
    """
    suffix = path.suffix.lower()
    if suffix not in SCAN_READERS:
        raise BadFile(
            f"{path}: no format of scans is called {path.suffix!r}; "
            f"there are {listed(SCAN_READERS)}"
        )
    if name is not None and suffix != ".npz":
        raise BadArgument(f"{path} has no arrays with names, so that none is called {name!r}")
    try:
        if path.is_file() and path.stat().st_size > MOST_BYTES and suffix not in ARRAY_SUFFIXES:
            raise BadFile(
                f"{path} has {path.stat().st_size / 2**30:.1f} GB, and at most 2 GB are read; "
                "give fewer points, or an .npy file"
            )
    except OSError as error:
        raise BadFile(f"cannot read {path}: {error.strerror}") from error
    return SCAN_READERS[suffix](path, name)


def _parser(parse: Callable[[bytes], ScanContents]) -> "Reader":
    return lambda path, name: parsed_mesh(path, parse)


def _mesh(parse: Callable[[bytes], Parts]) -> "Reader":
    def read(content: bytes) -> ScanContents:
        points, faces = parse(content)[:2]
        return ScanContents(points, faces=faces)

    return _parser(read)


def _ply(content: bytes) -> ScanContents:
    points, faces, normals = parse_ply_and_normals(content)
    return ScanContents(points, normals, faces)


def _pcd(content: bytes) -> ScanContents:
    cloud = parse_pcd(content)
    notes: tuple[str, ...] = ()
    if cloud.unread:
        notes = (f"not read are the fields {some(cloud.unread)}",)
    if cloud.viewpoint is None:
        notes += (
            "the file names no viewpoint, or 0 0 0, which programs write that do not know it; if "
            "the points were seen from there, give the camera's position 0 0 0",
        )
    return ScanContents(cloud.points, cloud.normals, None, cloud.viewpoint, notes)


def _of_columns(numbers: NDArray[Any], columns: int) -> ScanContents:
    """Points, and normals if there are six columns and the last three are of unit length."""
    points, further = widened(numbers[:, :3]), widened(numbers[:, 3:6])
    with np.errstate(all="ignore"):
        of_unit_length = np.abs(np.linalg.norm(further, axis=1) - 1) < UNIT_TOLERANCE
    are_normals = further.shape[1] == 3 and of_unit_length.sum() > len(of_unit_length) / 2
    read = 6 if are_normals else 3
    notes: tuple[str, ...] = ()
    if are_normals:
        notes = ("columns 4 to 6 have length one and are taken for normals",)
    if columns > read:
        single = columns == read + 1
        which = f"column {columns} is" if single else f"columns {read + 1} to {columns} are"
        notes += (f"{which} not read",)
    return ScanContents(points, further if are_normals else None, notes=notes)


def _npy(path: Path, name: str | None) -> ScanContents:
    with taken_for(path, "scan", "give an array (N, 3) of points as numpy.save writes it"):
        array = mapped_array(path)
        if array.dtype.kind not in "iuf" or array.ndim < 2:
            raise BadFile(f"it holds {array.dtype} of shape {array.shape}, not points (N, 3)")
        rows = array.reshape(-1, array.shape[-1]) if array.shape[-1] == 3 else array
        if rows.ndim != 2 or rows.shape[1] < 3:
            raise BadFile(f"it holds an array of shape {array.shape}, not points (N, 3)")
        return _of_columns(rows[:, :6], rows.shape[1])


def _npz(path: Path, name: str | None) -> ScanContents:
    """The points that are called `name`, or the only ones, with what belongs to them."""
    do = "give an .npz file with an array (N, 3) called points, as numpy.savez writes it"
    with opened(path, "scan", do) as archive:
        headers = archive.headers
        name = _name_of_points(headers, name)
        count = headers[name].shape[0]

        def first_of(names: tuple[str, ...], fits: Callable[[Header], bool]) -> Array | None:
            """The first array that has one of the names and a header that fits."""
            for key in names:
                if key in headers and fits(headers[key]):
                    read.add(key)
                    return archive.array(key)
            return None

        read = {name}
        normals = first_of(
            (f"{name}_normals", *NORMALS), lambda h: _is_of_points(h) and h.shape[0] == count
        )
        faces = first_of(
            (f"{name}_faces", *FACES), lambda h: _is_of_points(h) and h.dtype.kind != "f"
        )
        camera = first_of(
            CAMERA, lambda h: h.dtype.kind in "iuf" and h.shape in ((3,), (1, 3), (3, 1))
        )
        unread = sorted(headers.keys() - read) + list(archive.others)
        return ScanContents(
            widened(archive.array(name)),
            None if normals is None else widened(normals),
            None if faces is None else faces.astype("i8"),
            None if camera is None else widened(camera).reshape(3),
            (f"not read are the arrays {some(unread)}",) if unread else (),
        )


Reader = Callable[[Path, str | None], ScanContents]
SCAN_READERS: dict[str, Reader] = {
    ".ply": _parser(_ply),
    ".obj": _mesh(MESH_READERS[".obj"]),
    ".off": _mesh(MESH_READERS[".off"]),
    ".pcd": _parser(_pcd),
    ".stl": _mesh(MESH_READERS[".stl"]),
    ".glb": _mesh(parse_glb),
    ".npz": _npz,
    ".npy": _npy,
    **dict.fromkeys((".xyz", ".txt", ".csv"), _parser(lambda text: _of_columns(*parse_xyz(text)))),
}


def with_normals(contents: ScanContents, camera: Array | None) -> ScanContents:
    """The scan with unit normals that point outwards, or without any if this is not known.

    Faces of a closed mesh that look inwards, and faces that look away from the camera, are turned
    round. A cloud has only the normals of its file, or those of neighbouring points turned to the
    camera. What is done is said in a note.
    """
    if contents.faces is not None:
        contents = _with_faces_outwards(contents, contents.faces, camera)
    points, faces, notes = contents.points, contents.faces, contents.notes
    normals = None if contents.normals is None else filled_normals(points, contents.normals)
    if normals is not None and normals.any():
        source = "normals are those of the file"
    elif faces is not None:
        normals = filled_normals(points, vertex_normals(points, faces))
        source = "normals are of the faces"
    elif camera is not None:
        normals, source = normals_of_neighbours(points), "normals are estimated from neighbours"
    else:
        normals = None
        source = "there are no normals: nothing says on which side of the points the inside is"
    if normals is not None and not normals.any():
        normals, source = None, "there are no normals: no face has an area"
    if normals is not None and camera is not None:
        turned = towards(normals, points, camera)
        count = int((turned != normals).any(axis=1).sum())
        if "estimated" in source:
            source += " and turned to the camera"
        elif count:
            source += f"; {count:,} are turned to the camera"
        normals = turned
    return replace(contents, normals=normals, notes=(*notes, source))


def _with_faces_outwards(
    contents: ScanContents, faces: Index, camera: Array | None
) -> ScanContents:
    points = contents.points
    if not len(edges_of_one_face(faces)):
        inwards, why = volume(points - points.mean(axis=0), faces) < 0, "look inwards"
    elif camera is not None:
        middles = points[faces].mean(axis=1)
        facing = ((camera - middles) * face_vectors(points, faces)).sum()
        inwards, why = bool(facing < 0), "look away from the camera"
    else:
        inwards, why = False, ""
    if not inwards:
        return contents
    turned = np.ascontiguousarray(faces[:, ::-1])
    note = f"the faces {why}, and are turned round"
    return replace(contents, faces=turned, notes=(*contents.notes, note))


@dataclass(frozen=True, eq=False)
class ReadScan:
    """A scan that was read from a file, and what was guessed about it.

    Attributes:
        scan: the scan in m, y up.
        unit: the unit of the file: m, cm, mm or in.
        up: the axis of the file that pointed up: x, y, z, -x, -y or -z.
        camera_position: (3,) m where the camera was, in the axes of the scan; None if unknown.
        notes: sentences on what was guessed, repaired and left out.
    """

    scan: Scan
    unit: str
    up: str
    camera_position: Array | None
    notes: tuple[str, ...]


def read_scan(
    path: str | Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    name: str | None = None,
    camera_position: ArrayLike | None = None,
    most: int = USUAL_LIMIT,
    sizes: Sizes = PERSON,
) -> ReadScan:
    """Read a scan of a person or of a part of one from a file, with or without faces.

    Formats are .ply, .pcd, .obj, .off, .stl, .glb, .npz, .npy, and .xyz, .txt or .csv with x y z
    and perhaps nx ny nz in each line. A floor and walls are left out. `unit` (m, cm, mm, in, or a
    number of m as text) and `up` (x, y, z, -x, -y, -z) are guessed if they are not given; `sizes`
    says how long what was scanned usually is. `name` is the array of points in an .npz file.
    `camera_position` (3,), in the file's own unit and axes, is from where all points were seen; an
    .npz or .pcd file may hold it, but 0 0 0 in a .pcd says nothing. Of a cloud of more than `most`
    points so many are drawn.

    Normals are those of the file, of its faces, or of neighbouring points; of the last it is not
    known on which side they are, unless the camera's position is. Weights are areas in m^2.

    Raises BadFile or BadScan for a file that holds no scan, UnknownName or BadArgument.
    """
    path = Path(path)
    if most < SMALLEST_LIMIT:
        raise BadArgument(f"`most` must be at least 1,000 points, not {most}")
    contents = contents_of(path, name)
    if camera_position is not None:
        place = reals("a camera's position", camera_position)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise BadArgument(f"a camera's position is three finite numbers, not {cut(str(place))}")
        contents = replace(contents, camera_position=place)
    try:
        return _read_contents(contents, path.suffix.lower(), unit, up, most, sizes)
    except (BadScan, BadFile) as error:
        raise BadScan(f"cannot use the scan {path}: {cut(error, 500)}") from error
    except MemoryError as error:
        raise BadFile(
            f"there is not enough memory for the scan {path}; give one with fewer points"
        ) from error


def _read_contents(
    contents: ScanContents, suffix: str, unit: str | None, up: str | None, most: int, sizes: Sizes
) -> ReadScan:
    contents = without_planes(cleaned(contents, most))
    cells = outline(contents.points)
    if len(cells) < FEWEST_PLACES:
        raise BadScan(
            "most of its points lie within a fiftieth of its size, so that the others are no part "
            "of the same thing; remove what is far away"
        )
    metres, axis = DECLARED_BY_FORMAT.get(suffix, (None, None))
    size = float(extents(cells @ principal_axes(cells).T).max())
    unit, of_unit = unit_of(size, unit, metres, sizes=sizes)
    scale = UNITS[unit]
    up, of_up = up_of(cells * scale, up, axis, axes="xyz", what="the scan")
    turn = UP_TO_Y[up]
    camera = contents.camera_position
    if camera is not None and not np.isfinite(camera).all():
        contents, camera = _noted(contents, "the camera's position is not finite"), None
    if camera is not None:
        camera = turn @ camera * scale
    contents = _noted(contents, of_unit, of_up)
    contents = replace(
        contents,
        points=np.ascontiguousarray(contents.points @ turn.T * scale),
        normals=None if contents.normals is None else units(contents.normals) @ turn.T,
    )
    contents = with_normals(contents, camera)
    scan, notes = _weighted(contents, most)
    return ReadScan(scan, unit, up, camera, (*contents.notes, *notes))


def _weighted(contents: ScanContents, most: int) -> tuple[Scan, tuple[str, ...]]:
    """The scan with the area of each point, as a cloud if it has too many points; and notes."""
    points, normals, faces = contents.points, contents.normals, contents.faces
    if faces is None:
        alone = int(far_points(points).sum())
        note = f"{points_are(alone)} far from all neighbours, and may not belong to the scan"
        return Scan(points, normals, None, areas_of_neighbours(points)), (note,) if alone else ()
    weights = areas_of_faces(points, faces)
    if not weights.any():
        raise BadScan("its faces have no area")
    scan = Scan(points, normals, faces, weights).thinned(most)
    if scan.n_points == len(points):
        return scan, ()
    note = f"{scan.n_points:,} of {len(points):,} points are drawn at random, without the faces"
    return scan, (f"{note} between them",)


def _noted(contents: ScanContents, *notes: str) -> ScanContents:
    return replace(contents, notes=(*contents.notes, *notes))
