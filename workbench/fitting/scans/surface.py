"""The surface of a scan: outline, normals and their side, areas, its boundary, loose points.

Normals and areas are from faces where there are any; otherwise from neighbours, a few thousand
points at a time. The normal of a point without faces is the direction in which its neighbours
spread least (Hoppe et al., Surface Reconstruction from Unorganized Points, 1992). At a boundary,
where a scan ends although the body does not, the closest point of a model is often not the one that
was measured, so that distances there pull the model over the edge.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.blocks.checks import from_zero
from workbench.fitting.scans.scan import Scan

MOST_OUTLINED = 200_000  # points that are looked at
OUTLINE_CELLS = 50  # cells along the longest side of the scan
CLUTTER_SHARE = 0.1  # of the points of a usual cell: one with fewer is clutter
SIZE_PERCENTILES = (1.0, 99.0)  # percentiles between which the scan's own size is looked for
SEED = 0
NEIGHBOURS = 16
NORMAL_CELLS = 100  # along the longest side of a cloud, whose means make normals: 2 cm of a person
FIRST_CIRCLE = 6  # neighbours, from which on circles around a point are looked at for its area
POINTS_AT_ONCE = 20_000  # points
SPARSE_RATIO = 2.0  # times as far from its neighbours as these from theirs: beside the surface
BOUNDARY_NEIGHBOURS = 48  # with 24, two to five times as many points of Kinect clouds are marked
BOUNDARY_GAP = 2 * np.pi / 3  # rad
LOOSE_NEIGHBOURS = 8  # nearest points of each that are looked at
SPACING_NEIGHBOUR = 4  # the neighbour whose distance, in the median, says how dense a scan is
LINKED_RATIO = 2.0  # times that distance: neighbours that are nearer hang together
LINKED_COSINE = 0.5  # cosine of the largest angle between the normals of points that hang together
FEWEST_LINKED = 3  # such neighbours of a point that is not loose


def outline(points: Array) -> Array:
    """The mean points (C, 3) of the cells that a scan (N, 3) fills; in the unit of the points.

    A cell with far fewer points than others is clutter. Dense and sparse regions count alike.
    """
    some = points
    if len(points) > MOST_OUTLINED:
        some = points[np.random.default_rng(SEED).choice(len(points), MOST_OUTLINED, replace=False)]
    means, cell, counts = means_of_cells(some, OUTLINE_CELLS)
    enough = counts >= CLUTTER_SHARE * np.median(counts[cell])
    return np.asarray(means[enough])


def means_of_cells(points: Array, along: int) -> tuple[Array, Index, Index]:
    """Means (C, 3) of the points (N, 3) in each cubic cell that holds some.

    There are `along` cells along the longest side of what holds 98 % of the points; points that are
    farther from it than it is long are left out. Also the cell of each point that is left, (M,),
    and how many points each cell holds, (C,). Points that are all at one place stay as they are.
    """
    low, high = np.percentile(points, SIZE_PERCENTILES, axis=0)
    size = float((high - low).max())
    if not size > 0:
        return points, np.arange(len(points)), np.ones(len(points), dtype=np.int64)
    inside = points[((points > low - size) & (points < high + size)).all(axis=1)]
    numbers = np.floor((inside - low) / (size / along)).astype(np.int64)
    numbers -= numbers.min(axis=0)
    _, cell, counts = np.unique(
        np.ravel_multi_index(tuple(numbers.T), tuple(numbers.max(axis=0) + 1)),
        return_inverse=True,
        return_counts=True,
    )
    sums = np.stack([np.bincount(cell, inside[:, axis]) for axis in range(3)], axis=1)
    return np.asarray(sums / counts[:, None]), cell, counts


def principal_axes(cells: Array) -> Array:
    """Rows (3, 3): the direction along which an outline spreads most comes first."""
    return np.asarray(np.linalg.eigh(np.cov(cells.T))[1].T[::-1])


def normals_of_neighbours(points: Array) -> Array:
    """Unit normals (M, 3) of a cloud, on either side: where its 16 nearest places spread least.

    The places are means of the points in cells of a hundredth of the cloud's size, where cells hold
    more than one. However dense a cloud of a person is, a normal is that of several centimetres:
    depth cameras round, so that their clouds are flat terraces 1 to 2 cm apart, and the normals of
    a smaller neighbourhood would be those of the terraces.
    """
    places = means_of_cells(points, NORMAL_CELLS)[0]
    if len(places) < NEIGHBOURS:
        places = points
    normals = np.empty_like(points)
    for rows, near in neighbourhoods(points, NEIGHBOURS, places):
        normals[rows] = least_spread(near)
    return normals


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
    neighbours = tree.query(points, k=NEIGHBOURS + 1)  # the first is the point itself
    radii, numbers = (np.asarray(queried) for queried in neighbours)
    k = np.arange(FIRST_CIRCLE, NEIGHBOURS + 1)
    areas = np.pi * (radii[:, FIRST_CIRCLE:] ** 2 / k).mean(axis=1)
    usual = np.array(np.median(areas[numbers[:, 1:]], axis=1))
    return np.asarray(np.minimum(areas, SPARSE_RATIO**2 * usual))


def filled_normals(points: Array, normals: Array) -> Array:
    """Unit normals (M, 3); where they are zero or not finite, that of the nearest point."""
    whole = units(normals)
    known = whole.any(axis=1)
    if known.all() or not known.any():
        return whole
    nearest = cKDTree(points[known]).query(points[~known])[1]
    whole[~known] = whole[known][nearest]
    return whole


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
    for start in range(0, len(points), POINTS_AT_ONCE):
        rows = slice(start, start + POINTS_AT_ONCE)
        yield rows, among[tree.query(points[rows], k=count)[1]]


def units(vectors: Array) -> Array:
    """Vectors (M, 3) divided by their lengths; zero where they are zero or not finite."""
    with np.errstate(all="ignore"):
        largest = np.abs(vectors).max(axis=1, keepdims=True)
        scaled = vectors / largest
        unit_vectors = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    unit_vectors[~np.isfinite(unit_vectors).all(axis=1)] = 0
    return np.asarray(unit_vectors)


def boundary(scan: Scan, *, width: float = 0.0) -> Mask:
    """Mark the points (M,) at the boundary of a scan, and those within `width` m of them.

    Of a mesh these are the ends of edges that only one face has. Of a cloud they are the points
    whose 48 neighbours, seen along the normal, leave a gap of more than 120 degrees (Bendels et
    al., Detecting Holes in Point Set Surfaces, 2006). Raises BadArgument for a width below 0.
    """
    from_zero("a boundary", width=width)
    if scan.faces is not None:
        at_boundary = np.zeros(scan.n_points, dtype=np.bool_)
        at_boundary[edges_of_one_face(scan.faces)] = True
    else:
        at_boundary = boundary_of_cloud(scan.points)
    if width and at_boundary.any():
        at_boundary = np.asarray(cKDTree(scan.points[at_boundary]).query(scan.points)[0] <= width)
    return at_boundary


def edges_of_one_face(faces: Index) -> Index:
    """The edges (E, 2) that only one of the faces (T, 3) has."""
    low, high = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).T
    N = int(faces.max(initial=0)) + 1
    numbers, counts = np.unique(low * N + high, return_counts=True)
    return np.stack(np.divmod(numbers[counts == 1], N), axis=1)


def boundary_of_cloud(points: Array) -> Mask:
    """Which points (M, 3) of a cloud have neighbours on one side only, (M,)."""
    count = min(BOUNDARY_NEIGHBOURS + 1, len(points))
    at_boundary = np.zeros(len(points), dtype=np.bool_)
    for rows, near in neighbourhoods(points, count):
        n = least_spread(near)
        first = np.cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(n, first)
        away = near[:, 1:] - points[rows, None]
        angles = np.sort(
            np.arctan2((away * second[:, None]).sum(axis=2), (away * first[:, None]).sum(axis=2)),
            axis=1,
        )
        gaps = np.diff(angles, axis=1, append=angles[:, :1] + 2 * np.pi)
        at_boundary[rows] = gaps.max(axis=1) > BOUNDARY_GAP
    return at_boundary


def loose_points(scan: Scan) -> Mask:
    """Which points (M,) hang together with fewer than three of their eight nearest neighbours.

    Two points hang together if they are nearer to each other than twice the spacing of the scan,
    and, where normals are known, if these are less than 60 degrees apart. The spacing is the median
    distance of the fourth neighbour. Points of a surface lie side by side and face the same way.
    Rusu and others remove points by the distances of their neighbours alone (Towards 3D point cloud
    based object maps for household environments, 2008). Of fewer than nine points, none is loose.
    """
    if scan.n_points <= LOOSE_NEIGHBOURS:
        return np.zeros(scan.n_points, dtype=bool)
    neighbours = cKDTree(scan.points).query(scan.points, k=LOOSE_NEIGHBOURS + 1)
    away, near = (np.asarray(queried)[:, 1:] for queried in neighbours)  # without the point itself
    together = away <= LINKED_RATIO * np.median(away[:, SPACING_NEIGHBOUR - 1])
    if scan.normals is not None:
        together &= np.einsum("nki,ni->nk", scan.normals[near], scan.normals) > LINKED_COSINE
    return np.asarray(together.sum(axis=1) < FEWEST_LINKED)
