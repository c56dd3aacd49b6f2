"""Stitching: the mesh whose edges are nearest to those of triangles deformed one by one.

    V = argmin sum over faces f and edges i of |X_f e_fi - (A V)_fi|^2

is linear least squares with one sparse matrix A for all three coordinates (SCAPE, Anguelov et al.
2005, eq. 1). A sees differences only, so of each connected component three directions stay open,
its translation: they are closed by saying where the component's centroid is.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky_banded
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee
from scipy.sparse.linalg import SuperLU, splu

from workbench.arrays import Array, Index
from workbench.blocks.functions import sparse_constant
from workbench.errors import BadMesh
from workbench.geometry.triangles import edge_matrix


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
        f, N = self.faces, self.n_vertices
        if f.ndim != 2 or f.shape[1] != 3 or not len(f):
            raise BadMesh(f"faces have shape {f.shape}, but must be (F, 3), at least one")
        wrong = ((f < 0) | (f >= N)).any(axis=1)
        if wrong.any():
            face = int(np.argmax(wrong))
            raise BadMesh(f"face {face} is {f[face].tolist()}, but there are {N} vertices from 0")

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

    def pulled(self, edges: ArrayLike) -> Array:
        """A' e (N, 3) of edges (F, 2, 3): what they ask of each vertex."""
        return np.asarray(self.A.T @ np.asarray(edges, dtype=float).reshape(2 * len(self.faces), 3))

    def vertices(self, edges: ArrayLike, centroids: ArrayLike | None = None) -> Array:
        """The vertices V (N, 3) m whose edges are nearest to the given edges (F, 2, 3) m.

        The edges leave the place of each of C components open: its vertices have their mean at
        the given one of the centroids (C, 3) m, or at the origin.
        """
        V = self.solve(self.pulled(edges))
        wanted = np.zeros((self.n_components, 3)) if centroids is None else np.asarray(centroids)
        return np.asarray(V + (wanted - self.centroids @ V)[self.components])

    def solve(self, pulls: Array) -> Array:
        """The V (N, k) with A'A V = pulls (N, k), the first vertex of every component at 0."""
        lu, kept = self._factors
        V = np.zeros(pulls.shape)
        V[kept] = lu.solve(pulls[kept])
        return V

    def solve_symbolic(self, pulls: cs.MX) -> cs.MX:
        """`solve` in symbols: two triangular solves, as sparse as the factors."""
        lu, kept = self._factors
        order = np.argsort(lu.perm_r)  # row i of the factors is row order[i] of what is kept
        L, U = (cs.MX(sparse_constant(factor)) for factor in (lu.L, lu.U))
        found = cs.solve(U, cs.solve(L, pulls[kept[order].tolist(), :]))
        place = np.full(self.n_vertices, len(kept))  # the pinned ones: a row of zeros at the end
        place[kept] = lu.perm_c
        return cs.vertcat(found, cs.MX.zeros(1, pulls.shape[1]))[place.tolist(), :]

    @cached_property
    def solved(self) -> Index:
        """The vertices that are solved for: all but the first one of every component."""
        first = np.unique(self.components, return_index=True)[1]
        return np.setdiff1d(np.arange(self.n_vertices), first)

    @cached_property
    def _factors(self) -> tuple[SuperLU, Index]:
        """A'A without the first vertex of every component, and the vertices that are left."""
        kept = self.solved
        normal = csc_array(self.A.T @ self.A)[kept][:, kept]
        # positive definite: no pivoting, and an order for symmetric matrices, keep it sparse
        lu = splu(
            csc_array(normal),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )
        return lu, kept


def banded_factor(stitching: Stitching) -> tuple[Array, Index]:
    """The Cholesky factor L of A'A for a program without sparse matrices, and its order.

    The factor (width, n) has L[j + m, j] in row m and column j, as LAPACK stores it. Its rows are
    the vertices `order` (n,), which Cuthill and McKee's algorithm keeps near their neighbours;
    those that `solve` puts at 0 are left out.
    """
    kept = stitching.solved
    normal = csr_array(stitching.A.T @ stitching.A)[kept][:, kept]
    places = reverse_cuthill_mckee(csr_array(normal), symmetric_mode=True)
    near = csr_array(normal[places][:, places])
    rows, columns = near.nonzero()
    width = 1 + int((rows - columns).max(initial=0))
    banded = np.zeros((width, len(kept)))
    below = rows >= columns
    banded[(rows - columns)[below], columns[below]] = near.data[below]
    return np.asarray(cholesky_banded(banded, lower=True)), kept[places]
