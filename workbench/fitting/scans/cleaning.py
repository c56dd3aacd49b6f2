"""What is left out of a scan before it is used, each time with a sentence that says so."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.fitting.scans.scan import BadScan, ScanContents, check_faces, drawn, faces_between
from workbench.fitting.scans.surface import OUTLINE_CELLS, least_spread, outline

LARGEST_COORDINATE = 1e9  # in the file's unit: farther out is no coordinate but damage
FEWEST_POINTS = 100  # points
FAR_RATIO = 20.0  # times the size of the scan from its middle: what cannot belong to it
ALONE_RATIO = 10.0  # times the usual distance from the nearest neighbour
MOST_PLANES = 3  # a floor and two walls
FACE_SAMPLES = 30_000  # points of faces
PLANES_TRIED, PLANE_NEIGHBOURS = 200, 12  # places of which a plane is tried, by so many neighbours
PLANE_THICKNESS = 0.01  # of the size of the scan: how far points of a plane may be from it
PLANE_SHARE = 0.1  # of the cells of a scan: a smaller plane may be a part of a body
PLANE_COSINE = 0.85  # cosine of the angle between the normal of a plane and those of its places
PLANE_WIDTH = 0.3  # of the size of the scan: how wide a plane is at least
PLANE_FLATNESS = 0.5  # of the thickness: the deviation of its places; 0.74 of those of a round side
PLANE_SHARPNESS = 1.2  # times as many cells within thrice the thickness: a body's side is round
ONE_SIDE_SHARE = 0.95  # of the other cells, which are in front of the plane


def cleaned(contents: ScanContents, most: int) -> ScanContents:
    """The points that can be used, at most `most` of a cloud; faces are renumbered with them.

    Left out are points that are not finite, missing measurements at the origin of a cloud, points
    of a mesh that no face uses, repeated points and points far from everything. Raises BadScan if
    fewer than 100 are left, or if faces name points that do not exist.
    """
    if not len(contents.points):
        raise BadScan("it holds no points")
    points, faces = contents.points, contents.faces
    if faces is not None:
        check_faces(faces, len(points))
        contents = replace(contents, faces=faces if len(faces) else None)
    with np.errstate(invalid="ignore"):
        finite = np.asarray((np.abs(points) < LARGEST_COORDINATE).all(axis=1))  # nor NaN
    contents = _kept(contents, finite, "NaN, infinite or beyond 1e9, and left out")
    if contents.faces is None:
        nothing = np.asarray(~contents.points.any(axis=1))
        if nothing.sum() > 1:
            contents = _kept(contents, ~nothing, "0 0 0, as missing ones are, and left out")
        if most < len(contents.points):
            chosen = drawn(len(contents.points), most)
            why = f"left out, drawn at random, for {most:,} are enough"
            contents = _kept(contents, chosen, why)
    else:
        used = np.zeros(len(contents.points), dtype=bool)
        used[contents.faces] = True
        contents = _kept(contents, used, "in no face, and left out")
    contents = _merged(contents)
    if len(contents.points):
        middle = np.median(contents.points, axis=0)
        distances = np.linalg.norm(contents.points - middle, axis=1)
        near = np.asarray(distances <= FAR_RATIO * np.percentile(distances, 90))
        contents = _kept(contents, near, "far from all others, and left out")
    if len(contents.points) < FEWEST_POINTS:
        reasons = "".join(f"; {note}" for note in contents.notes[-4:])
        raise BadScan(
            f"{len(contents.points)} different points are left of it, and a scan has at least "
            f"{FEWEST_POINTS}{reasons}"
        )
    return contents


def without_planes(contents: ScanContents) -> ScanContents:
    """The scan without a floor and walls: planes, at one side of all else, that nothing covers.

    A body's flat back, or the plane at which a scan was cut, is covered by its front, seen along
    the normal; and of the side of a body that was seen from there alone, three times as much lies
    within three times the distance from a plane.
    """
    for _ in range(MOST_PLANES):
        plane = _plane_beside(contents)
        if plane is None:
            break
        normal, place, band = plane
        above = np.asarray((contents.points - place) @ normal > band)
        if above.sum() < FEWEST_POINTS:
            break
        contents = _kept(
            contents, above, "on a plane beside the rest, a floor or a wall, and left out"
        )
    return contents


def _plane_beside(contents: ScanContents) -> tuple[Array, Array, float] | None:
    """The unit normal (3,) towards the rest, a point (3,) and half of the thickness of a plane."""
    points, camera = contents.points, contents.camera_position
    if contents.faces is not None:
        import trimesh  # a quarter of a second to import: not before it is needed

        mesh = trimesh.Trimesh(points, contents.faces, process=False)
        points = np.asarray(trimesh.sample.sample_surface(mesh, FACE_SAMPLES, seed=0)[0])
    cells = outline(points)
    if len(cells) < PLANE_NEIGHBOURS:
        return None
    size = float(np.ptp(cells, axis=0).max())
    thick = PLANE_THICKNESS * size
    rng = np.random.default_rng(0)
    tried = rng.choice(len(cells), min(PLANES_TRIED, len(cells)), replace=False)
    normals = least_spread(cells[cKDTree(cells).query(cells, k=PLANE_NEIGHBOURS)[1]])
    tried_normals, tried_places = normals[tried], cells[tried]
    heights = cells @ tried_normals.T - (tried_places * tried_normals).sum(axis=1)
    counts = (np.abs(heights) < thick).sum(axis=0)
    for k in np.argsort(-counts)[:10]:
        normal, place = _refined(cells, tried_normals[k], tried_places[k], thick)
        off = (cells - place) @ normal
        if (off > 2 * thick).sum() < (off < -2 * thick).sum():
            normal, off = -normal, -off
        behind = camera is not None and (camera - place) @ normal < 0
        if behind or not _is_bare(cells, normals, normal, place, size):
            continue
        exact = points[np.abs((points - place) @ normal) < thick]
        band = np.clip(4 * deviation((exact - place) @ normal), thick / 4, 2 * thick)
        return normal, place, float(band)
    return None


def _refined(cells: Array, normal: Array, place: Array, thick: float) -> tuple[Array, Array]:
    """The normal and the middle of the plane through all cells that are near to a first one."""
    for _ in range(5):
        near = cells[np.abs((cells - place) @ normal) < thick]
        if len(near) < 4:
            break
        place = near.mean(axis=0)
        normal = least_spread(near[None])[0]
    return normal, place


def _is_bare(cells: Array, normals: Array, normal: Array, place: Array, size: float) -> bool:
    """Whether a plane has nearly all else in front of it, and a broad and flat part that nothing in
    front covers, with sharp sides.
    """
    thick, off = PLANE_THICKNESS * size, (cells - place) @ normal
    within, rest, front = np.abs(off) < thick, np.abs(off) > 2 * thick, off > 3 * thick
    if not front.any() or (off[rest] > 0).mean() < ONE_SIDE_SHARE:
        return False
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    flat = (cells - place) @ np.stack([first, np.cross(normal, first)]).T
    covered = np.asarray(cKDTree(flat[front]).query(flat)[0]) <= size / OUTLINE_CELLS
    bare = ~covered & (np.abs(normals @ normal) > PLANE_COSINE)
    own = bare & within
    if own.sum() < max(PLANE_SHARE * len(cells), within.sum() / 4):
        return False
    axes = np.linalg.eigh(np.cov(flat[own].T))[1]
    sides = np.ptp(np.percentile(flat[own] @ axes, (5, 95), axis=0), axis=0)
    if sides.min() < PLANE_WIDTH * size or deviation(off[own]) > PLANE_FLATNESS * thick:
        return False
    around = bare & (np.abs(off) < 3 * thick)
    return bool(around.sum() <= PLANE_SHARPNESS * own.sum())


def deviation(numbers: Array) -> float:
    """The standard deviation of numbers (M,), by their median distance from the median."""
    return 1.4826 * float(np.median(np.abs(numbers - np.median(numbers))))


def far_points(points: Array) -> Mask:
    """Which points (M, 3) have no other within ten times the usual distance: (M,)."""
    distances = np.asarray(cKDTree(points).query(points, k=2)[0])[:, 1]
    return np.asarray(distances > ALONE_RATIO * np.median(distances), dtype=np.bool_)


def points_are(count: int) -> str:
    """The beginning of a sentence on so many points."""
    return "1 point is" if count == 1 else f"{count:,} points are"


def _kept(contents: ScanContents, mask: Mask, why: str) -> ScanContents:
    """The points that a mask chooses, and the faces between them."""
    count = int((~mask).sum())
    if not count:
        return contents
    return replace(
        contents,
        points=contents.points[mask],
        normals=None if contents.normals is None else contents.normals[mask],
        faces=None if contents.faces is None else faces_between(contents.faces, mask),
        notes=(*contents.notes, f"{points_are(count)} {why}"),
    )


def _merged(contents: ScanContents) -> ScanContents:
    """Every place once, with the normal of the first point there; no face is a line or twice."""
    points = contents.points + 0.0  # so that there is no -0
    _, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
    count = len(points) - len(first)
    if count:
        order = np.argsort(first)  # places in the order in which the file has them
        number = np.argsort(order)
        contents = replace(
            contents,
            points=points[first[order]],
            normals=None if contents.normals is None else contents.normals[first[order]],
            faces=None if contents.faces is None else number[place.ravel()[contents.faces]],
            notes=(
                *contents.notes,
                f"{points_are(count)} in the place of another, and merged with it",
            ),
        )
    if contents.faces is None:
        return contents
    corners, first = np.unique(np.sort(contents.faces, axis=1), axis=0, return_index=True)
    proper = (np.diff(corners, axis=1) > 0).all(axis=1)
    faces: Index = contents.faces[np.sort(first[proper])]
    return replace(contents, faces=faces if len(faces) else None)
