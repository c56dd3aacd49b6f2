"""The vertices of a mesh, or the places on its surface, that are closest to given points."""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index
from workbench.geometry.surface_tree import SurfaceTree

SAME = 1e-5  # m: a point nearer to a vertex follows it alone


def nearest(vertices: Array, points: Array) -> tuple[Array, Index]:
    """The distance of each point (M, 3) from the nearest vertex, and that vertex, (M,) both."""
    distances, numbers = cKDTree(vertices).query(points)
    return np.asarray(distances, np.float64), np.asarray(numbers, np.int64)


def read_off(vertices: Array, faces: Index, points: Array) -> csr_array:
    """Each point (M, 3) m as the mean of the corners of the closest triangle: (M, N).

    Rows sum to one. A point at a vertex (N, 3) m follows that vertex alone.
    """
    found = SurfaceTree(vertices, faces).closest(points)
    corners, shares = faces[found.faces], found.shares
    distance, vertex = nearest(vertices, points)
    same = distance < SAME
    corners[same], shares[same] = vertex[same, None], [1.0, 0.0, 0.0]
    shares[shares < 1e-6] = 0
    shares /= shares.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 3)
    shape = len(points), len(vertices)
    return csr_array((shares.ravel(), (rows, corners.ravel())), shape=shape)
