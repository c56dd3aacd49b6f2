"""Normals of a scan, and the area that each of its points stands for.

From faces where there are any; otherwise from neighbours, a few thousand points at a time. The
normal of a point without faces is the direction in which its neighbours spread least (Hoppe et al.,
Surface Reconstruction from Unorganized Points, 1992).
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index
from workbench.fitting.scan_outline import means_of_cells
from workbench.geometry.solids import face_vectors, sums_over_faces

NEIGHBOURS = 16
CELLS = 100  # along the longest side of a cloud, whose means make normals: 2 cm of a person
FEW = 6  # neighbours, from which on circles around a point are looked at for its area
AT_ONCE = 20_000  # points
SPARSE = 2.0  # times as far from its neighbours as these from theirs: a point beside the surface


def normals_of_faces(points: Array, faces: Index) -> Array:
    """Unit normals (M, 3): the sum over the faces of a point, by area; 0 where it vanishes."""
    return units(sums_over_faces(face_vectors(points, faces), faces, len(points)))


def areas_of_faces(points: Array, faces: Index) -> Array:
    """A third of the area of the faces around each point, (M,) m^2; the sum is the whole area."""
    areas = np.linalg.norm(face_vectors(points, faces), axis=1) / 3
    return sums_over_faces(areas[:, None], faces, len(points))[:, 0]


def normals_of_neighbours(points: Array) -> Array:
    """Unit normals (M, 3) of a cloud, on either side: where its 16 nearest places spread least.

    The places are means of the points in cells of a hundredth of the cloud's size, where cells hold
    more than one. However dense a cloud of a person is, a normal is that of several centimetres:
    depth cameras round, so that their clouds are flat terraces 1 to 2 cm apart, and the normals of
    a smaller neighbourhood would be those of the terraces.
    """
    places = means_of_cells(points, CELLS)[0]
    if len(places) < NEIGHBOURS:
        places = points
    found = np.empty_like(points)
    for rows, near in neighbourhoods(points, NEIGHBOURS, places):
        found[rows] = least_spread(near)
    return found


def least_spread(near: Array) -> Array:
    """The unit direction (m, 3) in which each of m sets of points (m, k, 3) spreads least."""
    spread = near - near.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(spread.transpose(0, 2, 1) @ spread)[1][:, :, 0])


def areas_of_neighbours(points: Array) -> Array:
    """The area that each point of a cloud stands for, (M,) m^2, from how dense its neighbours are.

    A circle around a point that reaches its k-th neighbour has an area of k times 1 / density in
    the mean, if points lie on the surface at random; the mean over k from 6 to 16 is taken. So the
    sum of f times these areas approaches the integral of f over the surface, whatever the density
    is. Points at an edge count up to twice. A point that is alone beside the surface would stand
    for a large area; no area is therefore larger than four times the median of its neighbours'.
    """
    tree = cKDTree(points)
    queried = tree.query(points, k=NEIGHBOURS + 1)  # the first is the point itself
    radii, numbers = (np.asarray(found) for found in queried)
    k = np.arange(FEW, NEIGHBOURS + 1)
    areas = np.pi * (radii[:, FEW:] ** 2 / k).mean(axis=1)
    usual = np.array(np.median(areas[numbers[:, 1:]], axis=1))
    return np.asarray(np.minimum(areas, SPARSE**2 * usual))


def filled(points: Array, normals: Array) -> Array:
    """Unit normals (M, 3); where they are zero or not finite, that of the nearest point."""
    found = units(normals)
    there = found.any(axis=1)
    if there.all() or not there.any():
        return found
    nearest = cKDTree(points[there]).query(points[~there])[1]
    found[~there] = found[there][nearest]
    return found


def towards(normals: Array, points: Array, place: Array) -> Array:
    """The same normals, each turned to the side on which a place (3,) is."""
    return np.where(((place - points) * normals).sum(axis=1, keepdims=True) < 0, -normals, normals)


def neighbourhoods(
    points: Array, count: int, places: Array | None = None
) -> Iterator[tuple[slice, Array]]:
    """For some points at a time the nearest `places`: (rows, (m, count, 3)).

    Without places these are the points, themselves included.
    """
    among = points if places is None else places
    tree = cKDTree(among)
    for start in range(0, len(points), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        yield rows, among[tree.query(points[rows], k=count)[1]]


def units(vectors: Array) -> Array:
    """Vectors (M, 3) divided by their lengths; zero where they are zero or not finite."""
    with np.errstate(all="ignore"):
        largest = np.abs(vectors).max(axis=1, keepdims=True)
        scaled = vectors / largest
        found = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    found[~np.isfinite(found).all(axis=1)] = 0
    return np.asarray(found)
