"""Reading scans from users' files: in metres with y up, and with a sentence on every guess."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, cut
from workbench.fitting.scan import BadScan, Scan
from workbench.fitting.scan_cleaning import cleaned, isolated, points_are
from workbench.fitting.scan_contents import Contents, contents_of
from workbench.fitting.scan_normals import with_normals
from workbench.fitting.scan_outline import outline, principal_axes
from workbench.fitting.scan_surface import areas_of_faces, areas_of_neighbours, units
from workbench.geometry.guesses import PERSON, UNITS, UP_TO_Y, Sizes, extents, unit_of, up_of

FEWEST, MOST = 1_000, 500_000  # points of a cloud; a fit uses a tenth of them
FEWEST_PLACES = 10  # cells that an outline fills; that of a person fills thousands
DECLARED = {".glb": ("m", "y")}  # by glTF 2.0, section 3.4


@dataclass(frozen=True, eq=False)
class ReadScan:
    """A scan that was read from a file, and what was guessed about it.

    >>> import numpy as np, tempfile
    >>> from workbench import load_body
    >>> body = load_body("small")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/scan.npy", 1000 * body.template)
    ...     read = read_scan(f"{folder}/scan.npy")
    >>> read.unit, read.up, read.scan.n_points
    ('mm', 'y', 369)

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
    most: int = MOST,
    sizes: Sizes = PERSON,
) -> ReadScan:
    """Read a scan of a person or of a part of one from a file, with or without faces.

    Formats are .ply, .pcd, .obj, .off, .stl, .glb, .npz, .npy, and .xyz, .txt or .csv with x y z
    and perhaps nx ny nz in each line. `unit` (m, cm, mm, in) and `up` (x, y, z, -x, -y, -z) are
    guessed if they are not given: see `unit_of` and `up_of`; `sizes` says how long what was scanned
    usually is. `name` is the array of points in an
    .npz file. `camera_position` (3,), in the file's own unit and axes, is from where all points
    were seen. An .npz file may hold it, and so may a .pcd file, as its viewpoint; there 0 0 0 is
    what programs write that do not know it, and is not taken. Of a cloud of more than `most` points
    so many are drawn.

    Normals are those of the file, of its faces, or of neighbouring points; of the last it is not
    known on which side they are, unless the camera's position is. Weights are areas in m^2.

    Raises BadFile or BadScan for a file that holds no scan, UnknownName or BadArgument.
    """
    path = Path(path)
    if most < FEWEST:
        raise BadArgument(f"`most` must be at least 1,000 points, not {most}")
    contents = contents_of(path, name)
    if camera_position is not None:
        contents = replace(contents, camera_position=_place(camera_position))
    try:
        return _read(contents, path.suffix.lower(), unit, up, most, sizes)
    except (BadScan, BadFile) as error:
        raise BadScan(f"cannot use the scan {path}: {cut(error, 500)}") from error
    except MemoryError as error:
        raise BadFile(
            f"there is not enough memory for the scan {path}; give one with fewer points"
        ) from error


def _read(
    contents: Contents, suffix: str, unit: str | None, up: str | None, most: int, sizes: Sizes
) -> ReadScan:
    contents = cleaned(contents, most)
    cells = outline(contents.points)
    if len(cells) < FEWEST_PLACES:
        raise BadScan(
            "most of its points lie within a fiftieth of its size, so that the others are no part "
            "of the same thing; remove what is far away"
        )
    metres, axis = DECLARED.get(suffix, (None, None))
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


def _weighted(contents: Contents, most: int) -> tuple[Scan, tuple[str, ...]]:
    """The scan with the area of each point, as a cloud if it has too many points; and notes."""
    points, normals, faces = contents.points, contents.normals, contents.faces
    if faces is None:
        alone = int(isolated(points).sum())
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


def _place(given: ArrayLike) -> Array:
    try:
        place = np.asarray(given, dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise BadArgument(
            f"a camera's position is three numbers, not this: {cut(error)}"
        ) from error
    if place.shape != (3,) or not np.isfinite(place).all():
        raise BadArgument(f"a camera's position is three finite numbers, not {cut(str(place))}")
    return place


def _noted(contents: Contents, *notes: str) -> Contents:
    return replace(contents, notes=(*contents.notes, *notes))
