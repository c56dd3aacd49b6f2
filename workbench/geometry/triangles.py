"""Triangles of a mesh: their edges, and the matrix that takes each one to where it is now.

With corners T_0, T_1, T_2 a triangle's edges are e_0 = T_2 - T_0 and e_1 = T_1 - T_0 (SCAPE,
Anguelov et al. 2005). Two edges leave a 3 x 3 matrix undecided, so a third axis goes with them:
n / sqrt(|n|) with n = e_1 x e_0, which is normal to the triangle and as long as the square root
of twice its area, so that it grows with the triangle (Sumner and Popovic 2004).

Stitching finds the mesh whose edges are nearest to those of triangles deformed one by one,

    V = argmin sum over faces f and edges i of |X_f e_fi - (A V)_fi|^2

linear least squares with one sparse matrix A for all three coordinates (SCAPE, eq. 1). A sees
differences only, so of each connected component three directions stay open, its translation: they
are closed by saying where the component's centroid is.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU, splu

from workbench.arrays import Array, Index
from workbench.blocks.functions import sparse_constant
from workbench.errors import BadMesh
from workbench.geometry.meshes import Mesh

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


def gradient_derivatives(template: ArrayLike, directions: ArrayLike, faces: Index) -> Array:
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


@dataclass(frozen=True, eq=False)
class Stitching:
    """The least-squares problem that stitches F triangles to a mesh of N vertices.

    Its matrix is factorised once, when it is first needed.

    Raises BadMesh for faces that are not triangles of those vertices.

    Attributes:
        faces: (F, 3).
        n_vertices: N.
    """

    faces: Index
    n_vertices: int

    def __post_init__(self) -> None:
        Mesh(np.zeros((self.n_vertices, 3)), self.faces)  # raises where these do not fit together
        if not len(self.faces):
            raise BadMesh("a mesh without faces has nothing to stitch; give at least one")

    def __getstate__(self) -> dict[str, Any]:
        """Without what was computed: a factorisation does not pickle."""
        return {"faces": self.faces, "n_vertices": self.n_vertices}

    @cached_property
    def A(self) -> csr_array:
        """The matrix (2 F, N) from vertices to edges."""
        return edge_matrix(self.faces, self.n_vertices)

    @cached_property
    def components(self) -> Index:
        """The connected component of each vertex, (N,), from 0; a vertex of no face is its own."""
        ties = abs(self.A.T) @ abs(self.A)
        return np.asarray(connected_components(ties, directed=False)[1], dtype=np.int64)

    @property
    def n_components(self) -> int:
        """C, the number of connected components."""
        return int(self.components.max()) + 1

    @cached_property
    def centroids(self) -> csr_array:
        """The matrix (C, N) that finds the mean of each component's vertices, rows sum to one."""
        sizes = np.bincount(self.components)
        where = self.components, np.arange(self.n_vertices)
        return csr_array((1 / sizes[self.components], where))

    def edge_sums(self, edges: ArrayLike) -> Array:
        """A' e (N, 3) of edges (F, 2, 3): the right side of the normal equations."""
        return np.asarray(self.A.T @ np.asarray(edges, dtype=float).reshape(2 * len(self.faces), 3))

    def vertices(self, edges: ArrayLike, centroids: ArrayLike | None = None) -> Array:
        """The vertices V (N, 3) m whose edges are nearest to the given edges (F, 2, 3) m.

        The edges leave the place of each of C components open: its vertices have their mean at
        the given one of the centroids (C, 3) m, or at the origin.
        """
        V = self.solve(self.edge_sums(edges))
        means = np.zeros((self.n_components, 3)) if centroids is None else np.asarray(centroids)
        return np.asarray(V + (means - self.centroids @ V)[self.components])

    def solve(self, right_side: Array) -> Array:
        """The V (N, k) with A'A V = right_side (N, k), the first vertex of every component at 0."""
        lu, rows = self._factors
        V = np.zeros(right_side.shape)
        V[rows] = lu.solve(right_side[rows])
        return V

    def solve_symbolic(self, right_side: cs.MX) -> cs.MX:
        """`solve` in symbols: two triangular solves, as sparse as the factors."""
        lu, rows = self._factors
        order = np.argsort(lu.perm_r)  # row i of the factors is row order[i] of what is kept
        L, U = (cs.MX(sparse_constant(factor)) for factor in (lu.L, lu.U))
        solution = cs.solve(U, cs.solve(L, right_side[rows[order].tolist(), :]))
        place = np.full(self.n_vertices, len(rows))  # the pinned ones: a row of zeros at the end
        place[rows] = lu.perm_c
        return cs.vertcat(solution, cs.MX.zeros(1, right_side.shape[1]))[place.tolist(), :]

    @cached_property
    def solved(self) -> Index:
        """The vertices that are solved for: all but the first one of every component."""
        first = np.unique(self.components, return_index=True)[1]
        return np.setdiff1d(np.arange(self.n_vertices), first)

    @cached_property
    def _factors(self) -> tuple[SuperLU, Index]:
        """A'A without the first vertex of every component, and the vertices that are left."""
        rows = self.solved
        normal = csc_array(self.A.T @ self.A)[rows][:, rows]
        # positive definite: no pivoting, and an order for symmetric matrices, keep it sparse
        lu = splu(
            csc_array(normal),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
        return lu, rows
