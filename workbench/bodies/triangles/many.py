"""The stitched surfaces of many poses and shapes at once.

Of M surfaces with F triangles each, every entry of the matrices B, D and of the edges is an array
(F, M). A product of 3 x 3 matrices is then a few operations on long rows, and the stitching is
solved for all coordinates of all surfaces together, by the one factorization that there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.forward.posing import world_rotations
from workbench.bodies.triangles.packed import PackedTriangles

TOGETHER = 16  # surfaces that are worked on at a time: more of them do not fit into a cache


@dataclass(frozen=True, eq=False)
class ManySurfaces:
    """V = L A' (B D Q e), as `TriangleArithmetic` has it, for M poses and shapes."""

    of: PackedTriangles

    def __call__(self, pose: Array, betas: Array) -> Array:
        """The vertices (M, N, 3) m for pose (M, K, 3) rad and betas (M, B), untranslated."""
        found = np.empty((len(pose), self.of.stitching.n_vertices, 3))
        most = min(TOGETHER, len(pose)) * len(self.of.edges)
        space = [np.empty(rows * most) for rows in (9, 9, 6, 6, 6)]  # fresh memory costs as much
        for first in range(0, len(pose), TOGETHER):
            some = slice(first, first + TOGETHER)
            found[some] = self._together(pose[some], betas[some], space)
        return found

    def _together(self, pose: Array, betas: Array, space: list[Array]) -> Array:
        of, M, F = self.of, len(pose), len(self.of.edges)
        B, D, shaped, edges, product = (
            part[: rows * F * M].reshape(-1, 3, F, M)
            for rows, part in zip((9, 9, 6, 6, 6), space, strict=True)
        )
        R = self._rotations(pose)
        for r, c in np.ndindex(3, 3):
            B[r, c] = of.weights @ R[r, c]
        np.matmul(of.shape_slopes, betas.T, out=D.reshape(9 * F, M))
        for axis in range(3):
            D[axis, axis] += 1.0
        bent = (of.bend_slopes @ pose.reshape(M, -1).T).reshape(2, 3, F, M)
        bent += of.edges.transpose(1, 2, 0)[..., None]
        _on_edges(D, bent, shaped, product)
        _on_edges(B, shaped, edges, product)
        cotangents = np.empty((of.stitching.n_vertices, 3, M))
        for axis in range(3):
            cotangents[:, axis] = self._onto_vertices @ edges[:, axis].reshape(2 * F, M)
        V = of.placed(cotangents.reshape(-1, 3 * M)).reshape(-1, 3, M)
        return np.asarray(V.transpose(2, 0, 1) + of.root)

    def _rotations(self, pose: Array) -> Array:
        """World rotations, (3, 3, K, M)."""
        M, K = pose.shape[:2]
        R = Rotation.from_rotvec(pose.reshape(-1, 3)).as_matrix().reshape(M, K, 3, 3)
        world = world_rotations(R, self.of.parents)
        return np.ascontiguousarray(world.transpose(2, 3, 1, 0))

    @cached_property
    def _onto_vertices(self) -> csr_array:
        """A' (N, 2 F) with all first edges before all second ones."""
        A = self.of.stitching.A
        first = np.arange(0, A.shape[0], 2)
        return csr_array(A[np.concatenate([first, first + 1])].T)


def _on_edges(matrices: Array, edges: Array, into: Array, product: Array) -> None:
    """Write M_f e_fi (2, 3, F, M), for matrices (3, 3, F, M) and edges (2, 3, F, M)."""
    np.multiply(matrices[None, :, 0], edges[:, None, 0], out=into)
    for c in (1, 2):
        into += np.multiply(matrices[None, :, c], edges[:, None, c], out=product)
