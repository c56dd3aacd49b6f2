"""Weighted means of a stitched surface without the surface: a sum over parts, bilinear inside.

A mean (a joint, a landmark) is linear in the edges X_f e_fi that stitching asks for, and these are

    X_f e_fi = sum over parts k of w_fk R_k (I + S_f betas) (e_fi + P_fi twists_f)

so that a mean m is root + trans + sum over k of R_k g_km, where g_km is linear in the products of
(1, betas) with (1, the twists that the faces of part k feel). The coefficients are found once.
For a few landmarks this takes a fraction of the time of the whole surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Index
from workbench.bodies.forward.posing import world_rotations
from workbench.bodies.triangles.packed import PackedTriangles


@dataclass(frozen=True, eq=False)
class PartOfMeans:
    """What one part adds to every mean, before it is turned by R_k.

    Attributes:
        part: the number k of its joint.
        felt: (j,) the joints whose twists its faces feel.
        coefficients: (3 M, (1 + B) (1 + 3 j)), of the products of (1, betas) and (1, twists).
    """

    part: int
    felt: Index
    coefficients: Array


@dataclass(frozen=True, eq=False)
class StitchedMeans:
    """M means of the vertices of a triangle body, by a regressor (M, N) whose rows sum to one.

    Attributes:
        of: the arrays of the body.
        regressor: (M, N).
    """

    of: PackedTriangles
    regressor: csr_array

    def __call__(self, poses: Array, betas: Array, trans: Array) -> Array:
        """The means (P, M, 3) m at poses (P, K, 3) rad, betas (P, B) and trans (P, 3) m."""
        P, K = poses.shape[:2]
        local = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(P, K, 3, 3)
        R = world_rotations(local, self.of.parents)
        shapes = np.concatenate([np.ones((P, 1)), betas], axis=1)
        found = self._sums[:, None] * (self.of.root + trans)[:, None]
        for one in self.parts:
            twists = np.concatenate([np.ones((P, 1)), poses[:, one.felt].reshape(P, -1)], axis=1)
            products = (shapes[:, :, None] * twists[:, None]).reshape(P, -1)
            straight = (products @ one.coefficients.T).reshape(P, -1, 3)
            found += straight @ R[:, one.part].transpose(0, 2, 1)
        return np.asarray(found)

    @cached_property
    def on_edges(self) -> Array:
        """The means, the root joint being at 0, as sums over the edges asked for: (M, F, 2)."""
        rows = self.regressor.toarray() - self._sums[:, None] * self.of.root_row.toarray()
        cotangents = self.of.stitching.A @ self.of.stitching.solve(np.ascontiguousarray(rows.T))
        return np.asarray(cotangents.T).reshape(len(rows), -1, 2)

    @property
    def _sums(self) -> Array:
        """What the rows sum to, one up to rounding: (M,)."""
        return np.asarray(self.regressor.sum(axis=1), dtype=np.float64).ravel()

    @cached_property
    def parts(self) -> tuple[PartOfMeans, ...]:
        """The parts that have faces, with their coefficients."""
        columns = self.of.weights.tocsc()
        found = []
        for k in range(columns.shape[1]):
            some = slice(columns.indptr[k], columns.indptr[k + 1])
            faces, weights = columns.indices[some].astype(np.int64), columns.data[some]
            if len(faces):
                found.append(self._part(k, faces, weights))
        return tuple(found)

    def _part(self, k: int, faces: Index, weights: Array) -> PartOfMeans:
        of, M, B = self.of, self.regressor.shape[0], self.of.shapedirs.shape[3]
        near = of.near[faces]
        felt, slots = np.unique(near, return_inverse=True)
        slots = slots.reshape(near.shape)
        D = np.concatenate(  # what 1 and each of the betas contribute, (n, 3, 3, 1 + B)
            [np.broadcast_to(np.eye(3)[..., None], (len(faces), 3, 3, 1)), of.shapedirs[faces]], 3
        )
        shares = self.on_edges[:, faces] * weights[:, None]  # (M, n, 2)
        total = np.zeros((M, 3, 1 + B, 1 + 3 * len(felt)))
        total[..., 0] = np.einsum("mfi,facb,fic->mab", shares, D, of.edges[faces], optimize=True)
        bends = of.bends[faces].reshape(len(faces), 2, 3, near.shape[1], 3)
        for slot in range(len(felt)):
            f, j = np.nonzero(slots == slot)
            total[..., 1 + 3 * slot : 4 + 3 * slot] = np.einsum(
                "mfi,facb,fict->mabt", shares[:, f], D[f], bends[f, :, :, j], optimize=True
            )
        return PartOfMeans(k, felt, total.reshape(3 * M, -1))
