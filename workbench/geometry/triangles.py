"""Triangles of a mesh: their edges, and the matrix that takes each one to where it is now.

With corners T_0, T_1, T_2 a triangle's edges are e_0 = T_2 - T_0 and e_1 = T_1 - T_0 (SCAPE,
Anguelov et al. 2005). Two edges leave a 3 x 3 matrix undecided, so a third axis goes with them:
n / sqrt(|n|) with n = e_1 x e_0, which is normal to the triangle and as long as the square root
of twice its area, so that it grows with the triangle (Sumner and Popovic 2004).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.errors import BadMesh

FLAT = 1e-12  # of the longest edge squared: twice the area of a triangle that is a line


def edges(vertices: ArrayLike, faces: Index) -> Array:
    """e_0 and e_1 of every face: vertices (..., N, 3) m -> (..., F, 2, 3) m."""
    v = np.asarray(vertices, dtype=float)
    first, second, third = (v[..., faces[:, i], :] for i in range(3))
    return np.stack([third - first, second - first], axis=-2)


def edge_matrix(faces: Index, n_vertices: int) -> csr_array:
    """A (2 F, N) with A V the edges of V: row 2 f is e_0 of face f, row 2 f + 1 its e_1."""
    F = len(faces)
    ends = np.stack([faces[:, 2], faces[:, 0], faces[:, 1], faces[:, 0]], axis=1)
    rows = np.repeat(np.arange(2 * F), 2)
    A = csr_array((np.tile([1.0, -1.0], 2 * F), (rows, ends.ravel())), shape=(2 * F, n_vertices))
    A.sum_duplicates()
    return A


def frames(vertices: ArrayLike, faces: Index) -> Array:
    """e_0, e_1 and the third axis as columns: vertices (..., N, 3) m -> (..., F, 3, 3) m."""
    return frames_on(edges(vertices, faces))


def frames_on(e: Array) -> Array:
    """Frames on edges (..., F, 2, 3) m, which need not fit together to a mesh; see `frames`."""
    n = np.cross(e[..., 1, :], e[..., 0, :])  # m^2
    root = np.sqrt(np.linalg.norm(n, axis=-1, keepdims=True))
    axis = np.divide(n, root, out=np.zeros_like(n), where=root > 0)
    return np.stack([e[..., 0, :], e[..., 1, :], axis], axis=-1)


def gradients(template: ArrayLike, vertices: ArrayLike, faces: Index) -> Array:
    """X_f with X_f E_f(template) = E_f(vertices), E_f being the frames: (..., F, 3, 3).

    A rotation or a uniform scaling of the whole mesh is found in every face; of another affine
    map, what it does within the face's plane. Raises BadMesh if a face of the template is a line.
    """
    return np.asarray(frames(vertices, faces) @ _inverse_frames(template, faces))


def gradient_slopes(template: ArrayLike, directions: ArrayLike, faces: Index) -> Array:
    """How X_f begins to change as the template moves along `directions` (N, 3, B): (F, 3, 3, B).

    Within the face's plane X_f is linear in the vertices, so these slopes are exact there at any
    distance; the third axis turns and grows, and they are its tangent. Raises BadMesh if a
    face of the template is a line.
    """
    moved = np.moveaxis(np.asarray(directions, dtype=float), 2, 0)  # (B, N, 3)
    e, de = edges(template, faces), edges(moved, faces)
    n = np.cross(e[:, 1], e[:, 0])
    dn = np.cross(de[..., 1, :], e[:, 0]) + np.cross(e[:, 1], de[..., 0, :])
    length = np.linalg.norm(n, axis=-1, keepdims=True)
    inverse = _inverse_frames(template, faces)
    along = (n * dn).sum(axis=-1, keepdims=True) / length**2
    d_axis = (dn - 0.5 * n * along) / np.sqrt(length)
    slopes = np.stack([de[..., 0, :], de[..., 1, :], d_axis], axis=-1) @ inverse
    return np.ascontiguousarray(np.moveaxis(slopes, 0, 3))


def soup(template: ArrayLike, faces: Index, X: Array) -> Array:
    """The corners (F, 3, 3) m of disconnected triangles, each deformed about its own centroid."""
    corners = np.asarray(template, dtype=float)[faces]
    middle = corners.mean(axis=1, keepdims=True)
    return np.asarray(middle + (corners - middle) @ X.transpose(0, 2, 1))


def _inverse_frames(template: ArrayLike, faces: Index) -> Array:
    e = edges(template, faces)
    longest = np.linalg.norm(e, axis=-1).max(axis=-1)
    area = np.linalg.norm(np.cross(e[:, 1], e[:, 0]), axis=-1)
    flat: Any = ~(area > FLAT * longest**2)
    if flat.any():
        raise BadMesh(
            f"face {int(np.argmax(flat))} of the template has no area ({int(flat.sum())} such "
            "faces), so that its deformation is not defined; remove it, or move a corner"
        )
    return np.asarray(np.linalg.inv(frames(template, faces)))
