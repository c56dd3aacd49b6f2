"""Ways along the edges of a mesh, and the best motion with a scale between two point sets."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from workbench.arrays import Array, Index
from workbench.geometry.rigid import Similarity, procrustes
from workbench.geometry.solids import lengths, mesh_edges


def along_edges(vertices: Array, triangles: Index, sources: list[Index]) -> Array:
    """From each set of vertices to every vertex along the mesh's edges, (len(sources), N) m.

    Dijkstra's shortest paths: never shorter than the surface's own, and longer where edges zigzag.
    Infinite where there is no way.
    """
    pairs = mesh_edges(triangles)
    N, weights = len(vertices), lengths(vertices, pairs)
    graph = csr_array((weights, (pairs[:, 0], pairs[:, 1])), shape=(N, N))
    return np.array(
        [dijkstra(graph, directed=False, indices=some, min_only=True) for some in sources]
    ).reshape(len(sources), N)


def umeyama(source: Array, target: Array) -> Similarity:
    """The motion with a scale that takes source to target, both (N, 3), with least squared error.

    The rotation is that of `procrustes`, and the scale is trace(R' M) / sum |p - p0|^2 with M the
    covariance sum (q - q0) (p - p0)' (Umeyama 1991, eq. 41-43), and not negative.
    """
    R, p0, q0 = procrustes(source, target).R, source.mean(axis=0), target.mean(axis=0)
    turned = (source - p0) @ R.T
    scale = max(0.0, float(np.sum(turned * (target - q0)) / np.sum(turned**2)))
    return Similarity(R, q0 - scale * R @ p0, scale)
