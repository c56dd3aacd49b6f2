"""Where a scan ends although the body does not: points to be left out of a fit.

At a boundary the closest point of a model is often not the one that was measured, so that distances
there pull the model over the edge.
"""

import numpy as np
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument
from workbench.fitting.scan import Scan
from workbench.fitting.scan_surface import least_spread, neighbourhoods

AROUND = 48  # neighbours: with 24, two to five times as many points of Kinect clouds are marked
GAP = 2 * np.pi / 3  # rad


def boundary(scan: Scan, *, width: float = 0.0) -> Mask:
    """Mark the points (M,) at the boundary of a scan, and those within `width` m of them.

    Of a mesh these are the ends of edges that only one face has. Of a cloud they are the points
    whose 48 neighbours, seen along the normal, leave a gap of more than 120 degrees (Bendels et
    al., Detecting Holes in Point Set Surfaces, 2006). Raises BadArgument for a width below 0.
    """
    if not 0 <= width < np.inf:
        raise BadArgument(f"a boundary has a width of 0 m or more, not {width:g}")
    if scan.faces is not None:
        found = boundary_of_faces(scan.faces, scan.n_points)
    else:
        found = boundary_of_cloud(scan.points)
    if width and found.any():
        found = np.asarray(cKDTree(scan.points[found]).query(scan.points)[0] <= width)
    return found


def boundary_of_faces(faces: Index, M: int) -> Mask:
    """Which of M points are ends of edges with one face, (M,)."""
    ends = edges_of_one_face(faces)
    found = np.zeros(M, dtype=np.bool_)
    found[ends] = True
    return found


def edges_of_one_face(faces: Index) -> Index:
    """The edges (E, 2) that only one of the faces (T, 3) has."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = edges[np.lexsort(edges.T)]
    same = (np.diff(edges, axis=0) == 0).all(axis=1)
    alone = np.ones(len(edges), dtype=bool)
    alone[1:] &= ~same
    alone[:-1] &= ~same
    return np.asarray(edges[alone])


def boundary_of_cloud(points: Array) -> Mask:
    """Which points (M, 3) of a cloud have neighbours on one side only, (M,)."""
    count = min(AROUND + 1, len(points))
    found = np.zeros(len(points), dtype=np.bool_)
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
        found[rows] = gaps.max(axis=1) > GAP
    return found
