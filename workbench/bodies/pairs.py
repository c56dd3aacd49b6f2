"""Weighted means of vertices without the vertices: one rest point for each joint that moves them.

A landmark is a weighted mean of vertices, and a vertex a weighted mean of what each joint makes of
it. Landmark m, sum_i r_mi sum_j w_ij G_j (v_i; 1), is therefore a sum over joints of

    G_j (sum_i r_mi w_ij v_i; sum_i r_mi w_ij),

so that each pair of a landmark and a joint that moves it needs one rest point, whatever the
number of vertices. This is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.numeric import SurfaceArrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pairs:
    """Rest points for each pair of a landmark and a joint that moves it, P of them, planar."""

    joint: NDArray[np.int64]  # (P,)
    first: NDArray[np.int64]  # (L,) where each landmark's pairs begin
    used: NDArray[np.int64]  # the features that move any of them
    template: Array  # (3 P,) m
    shapedirs: Array  # (B, 3 P)
    posedirs: Array  # (used, 3 P)
    mass: Array  # (P,)

    @staticmethod
    def of(body: SurfaceArrays, vertices: Sequence[int], regressor: csr_array) -> Pairs:
        """Of the means (L, n) of so many vertices, which are named."""
        r, some = regressor.toarray(), list(vertices)
        mixed = np.einsum("li,ij->lji", r, body.weights[some])  # (L, K, n)
        landmark, joint = np.nonzero(abs(mixed).sum(axis=2))
        # a landmark without weight still has a place
        empty = np.setdiff1d(np.arange(len(r)), landmark)
        landmark, joint = np.append(landmark, empty), np.append(joint, 0 * empty)
        order = np.argsort(landmark, kind="stable")
        landmark, joint = landmark[order], joint[order]
        A = mixed[landmark, joint]  # (P, n)
        P = len(A)

        def summed(arrays: Array) -> Array:  # (n, 3, b) -> (b, 3 P)
            return np.ascontiguousarray(
                np.tensordot(A, arrays, axes=(1, 0)).transpose(2, 1, 0)
            ).reshape(-1, 3 * P)

        posedirs = summed(body.posedirs[some])
        used = np.flatnonzero(abs(posedirs).max(axis=1, initial=0))
        return Pairs(
            joint, np.searchsorted(landmark, np.arange(len(r))), used,
            summed(body.template[some][:, :, None])[0], summed(body.shapedirs[some]),
            np.ascontiguousarray(posedirs[used]), A.sum(axis=1),
        )  # fmt: skip

    def points(self, G: Array, features: Array, betas: Array) -> Array:
        """(M, L, 3) m, before translation."""
        M, P = len(G), len(self.joint)
        flat = betas @ self.shapedirs + features[:, self.used] @ self.posedirs + self.template
        rest = flat.reshape(M, 3, P)
        turns = G.transpose(0, 2, 3, 1)[..., self.joint]  # (M, 3, 4, P)
        moved = np.einsum("mdcp,mcp->mdp", turns[:, :, :3], rest) + turns[:, :, 3] * self.mass
        return np.asarray(np.add.reduceat(moved, self.first, axis=2).transpose(0, 2, 1))

    def expression(self, G: Sequence[cs.MX], features: cs.MX, betas: cs.MX) -> cs.MX:
        """(3, L) m in symbols, before translation."""
        P = len(self.joint)
        shaped = cs.sparsify(cs.DM(self.shapedirs.T)) @ betas
        bent = cs.sparsify(cs.DM(self.posedirs.T)) @ features[self.used.tolist()]
        rest = cs.reshape(cs.DM(self.template) + shaped + bent, P, 3).T  # (3, P)
        moved = [
            G[joint][:, :3] @ rest[:, p] + G[joint][:, 3] * self.mass[p]
            for p, joint in enumerate(self.joint.tolist())
        ]
        edges = [*self.first.tolist(), P]
        return cs.horzcat(*[sum(moved[i:j][1:], moved[i]) for i, j in pairwise(edges)])
