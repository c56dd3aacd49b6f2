"""Distances along a surface."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from workbench.arrays import Array, Index
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
