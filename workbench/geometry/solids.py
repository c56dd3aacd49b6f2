"""What a triangle mesh encloses, its areas and its edges."""

import numpy as np
import scipy.sparse.linalg
from scipy.sparse import csc_array, csr_array, diags_array

from workbench.arrays import Array, Index
from workbench.errors import BadMesh


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


def sums_over_faces(of_faces: Array, faces: Index, n_vertices: int) -> Array:
    """The sums (N, C) over the faces around each vertex of what faces (F, C) have."""
    corners = faces.ravel()
    sums = [np.bincount(corners, np.repeat(each, 3), minlength=n_vertices) for each in of_faces.T]
    return np.stack(sums, axis=1)


def vertex_normals(vertices: Array, faces: Index) -> Array:
    """Unit normals (N, 3): means of the normals of the faces around, weighted by their areas.

    A vertex in no face has the normal 0.
    """
    total = sums_over_faces(face_vectors(vertices, faces), faces, len(vertices))
    lengths = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(lengths > 0, lengths, 1.0))


def mesh_edges(triangles: Index) -> Index:
    """Every edge once, (E, 2), the smaller number first."""
    both = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return np.unique(np.sort(both, axis=1), axis=0)


def lengths(vertices: Array, pairs: Index) -> Array:
    """The lengths (E,) m of edges (E, 2)."""
    result: Array = np.linalg.norm(vertices[pairs[:, 1]] - vertices[pairs[:, 0]], axis=1)
    return result


def heat(vertices: Array, faces: Index, spread: float) -> scipy.sparse.linalg.SuperLU:
    """One implicit step of the graph's heat equation, I + spread^2 L / 2, ready to be solved.

    Solving with it spreads each column by about `spread` metres over the mesh, and keeps its sum.
    """
    edges, N = mesh_edges(faces), len(vertices)
    pairs = np.concatenate([edges, edges[:, ::-1]])
    flow = np.tile(1 / np.maximum(lengths(vertices, edges), 1e-6) ** 2, 2)
    A = csr_array((flow, (pairs[:, 0], pairs[:, 1])), shape=(N, N))
    L = csr_array(diags_array(np.asarray(A.sum(axis=1)).ravel()) - A)
    return scipy.sparse.linalg.splu(csc_array(diags_array(np.ones(N)) + 0.5 * spread**2 * L))


def random_surface_points(
    vertices: Array, faces: Index, count: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Points (count, 3) m spread evenly over a mesh's area, and the unit normals there.

    vertices (N, 3) m; faces (F, 3). Raises BadMesh if the mesh has no area.
    """
    a, b, c = (np.asarray(vertices, dtype=float)[faces[:, i]] for i in range(3))
    doubled = np.cross(b - a, c - a)  # m^2, along the normal
    areas = np.linalg.norm(doubled, axis=1)
    if not areas.sum() > 0:
        raise BadMesh("the faces have no area from which points could be drawn")
    chosen = rng.choice(len(faces), count, p=areas / areas.sum())
    s, t = rng.uniform(size=(2, count, 1))
    root = np.sqrt(s)  # (1 - root, root (1 - t), root t) is uniform on a triangle
    points = (1 - root) * a[chosen] + root * (1 - t) * b[chosen] + root * t * c[chosen]
    return points, doubled[chosen] / areas[chosen, None]
