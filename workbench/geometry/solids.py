"""What a triangle mesh encloses, and its edges."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index


def volume(vertices: Array, triangles: Index) -> float:
    """Inside a closed surface, m^3: positive if its triangles face outwards.

    Where the surface runs through itself, what is inside twice counts twice, and what is turned
    inside out counts negative. An open surface is closed by cones from the mean of its vertices.
    """
    a, b, c = ((vertices - vertices.mean(axis=0))[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def mesh_edges(triangles: Index) -> Index:
    """Every edge once, (E, 2), the smaller number first."""
    both = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return np.unique(np.sort(both, axis=1), axis=0)


def lengths(vertices: Array, pairs: Index) -> Array:
    """The lengths (E,) m of edges (E, 2)."""
    found: Array = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    return found


def lids(triangles: Index) -> list[Index]:
    """The open ends of a piece of surface: each the directed edges (n, 2) that close it."""
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    known = {(int(a), int(b)) for a, b in directed}
    open_edges = np.array([(b, a) for a, b in sorted(known) if (b, a) not in known], dtype=np.int64)
    if not len(open_edges):
        return []
    n = int(open_edges.max()) + 1
    graph = coo_array((np.ones(len(open_edges)), tuple(open_edges.T)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    ends = label[open_edges[:, 0]]
    return [open_edges[ends == end] for end in np.unique(ends)]


def piece_volume(vertices: Array, triangles: Index) -> float:
    """Inside a piece of surface whose open ends are closed by cones from their mean points, m^3."""
    points, faces = [vertices], [triangles]
    for number, lid in enumerate(lids(triangles)):
        points.append(vertices[np.unique(lid)].mean(axis=0, keepdims=True))
        top = np.full((len(lid), 1), len(vertices) + number)
        faces.append(np.hstack([lid, top]))
    return volume(np.vstack(points), np.vstack(faces))
