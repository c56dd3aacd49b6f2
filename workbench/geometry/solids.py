"""What a triangle mesh encloses, its areas and its edges."""

import numpy as np

from workbench.arrays import Array, Index


def volume(vertices: Array, triangles: Index) -> float:
    """Inside a closed surface, m^3: positive if its triangles face outwards.

    Where the surface runs through itself, what is inside twice counts twice, and what is turned
    inside out counts negative. An open surface is closed by cones from the mean of its vertices.
    """
    a, b, c = ((vertices - vertices.mean(axis=0))[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def area(vertices: Array, triangles: Index) -> float:
    """The area of a surface (m^2) with vertices (N, 3) m and triangles (F, 3)."""
    return float(np.linalg.norm(face_vectors(vertices, triangles), axis=1).sum())


def face_vectors(vertices: Array, faces: Index) -> Array:
    """Normals of faces (F, 3), as long as the faces' areas in m^2."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.asarray(np.cross(b - a, c - a) / 2)


def sums_around(of_faces: Array, faces: Index, n_vertices: int) -> Array:
    """The sums (N, C) over the faces around each vertex of what faces (F, C) have."""
    corners = faces.ravel()
    sums = [np.bincount(corners, np.repeat(each, 3), minlength=n_vertices) for each in of_faces.T]
    return np.stack(sums, axis=1)


def vertex_normals(vertices: Array, faces: Index) -> Array:
    """Unit normals (N, 3): means of the normals of the faces around, weighted by their areas.

    A vertex in no face has the normal 0.
    """
    total = sums_around(face_vectors(vertices, faces), faces, len(vertices))
    lengths = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(lengths > 0, lengths, 1.0))


def mesh_edges(triangles: Index) -> Index:
    """Every edge once, (E, 2), the smaller number first."""
    both = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return np.unique(np.sort(both, axis=1), axis=0)


def lengths(vertices: Array, pairs: Index) -> Array:
    """The lengths (E,) m of edges (E, 2)."""
    found: Array = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    return found
