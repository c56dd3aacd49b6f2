"""Weighted means of vertices without the vertices: one rest point for each joint that moves them.

A landmark is a weighted mean of vertices, and a vertex a weighted mean of what each joint makes of
it. Landmark m, sum_i r_mi sum_j w_ij G_j (v_i; 1), is therefore a sum over joints of

    G_j (sum_i r_mi w_ij v_i; sum_i r_mi w_ij),

so that each pair of a landmark and a joint that moves it needs one rest point, whatever the
number of vertices. This is exact. A landmark may have an offset o_m, by which all that it is a mean
of is displaced at rest. It displaces rest point p of the landmark by m_p o_m, m_p being its mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csc_array, csr_array

from workbench.arrays import Array, Index
from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.arrays import SurfaceArrays
from workbench.bodies.forward.skinning import blend_points


@dataclass(frozen=True, eq=False)
class RestPoints:
    """Rest points for each pair of a landmark and a joint that moves it, P of them, planar.

    Attributes:
        joint: (P,) the joint that moves each rest point.
        first: (L,) the first rest point of each landmark.
        used: the features that move any of them.
        template: (3 P,) m.
        shapedirs: (B, 3 P).
        posedirs: (used, 3 P).
        mass: (P,) the sum of the weights behind each rest point.
    """

    joint: Index
    first: Index
    used: Index
    template: Array
    shapedirs: Array
    posedirs: Array
    mass: Array

    @staticmethod
    def of(body: SurfaceArrays, vertices: Sequence[int], regressor: csr_array) -> RestPoints:
        """The rest points of landmarks, by a regressor (L, n) of the numbered vertices."""
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
        return RestPoints(
            joint,
            np.searchsorted(landmark, np.arange(len(r))),
            used,
            summed(body.template[some][:, :, None])[0],
            summed(body.shapedirs[some]),
            np.ascontiguousarray(posedirs[used]),
            A.sum(axis=1),
        )

    @cached_property
    def landmark(self) -> Index:
        """The landmark of each rest point, (P,)."""
        counts = np.diff(self.first, append=len(self.joint))
        return np.repeat(np.arange(len(self.first)), counts)

    def rest(self, features: Array, betas: Array, offsets: Array | None = None) -> Array:
        """The rest points (..., 3, P) m, for features (..., F) and betas (..., B).

        `offsets` (..., L, 3) m displace the landmarks, where there are any.
        """
        flat = betas @ self.shapedirs + features[..., self.used] @ self.posedirs + self.template
        found = flat.reshape(*flat.shape[:-1], 3, -1)
        if offsets is None:
            return found
        return np.asarray(found + self.mass * np.swapaxes(offsets[..., self.landmark, :], -1, -2))

    def turns(self, G: Array) -> Array:
        """The motion of each rest point's joint, (..., 3, 4, P), for motions (..., K, 3, 4)."""
        return np.ascontiguousarray(np.moveaxis(G[..., self.joint, :, :], -3, -1))

    def moved(self, turns: Array, rest: Array) -> Array:
        """The rest points where their joints take them, (..., 3, P) m."""
        turned: Array = np.einsum("...dcp,...cp->...dp", turns[..., :3, :], rest)
        return turned + turns[..., 3, :] * self.mass

    def summed(self, of_rest_points: Array) -> Array:
        """The sums over each landmark's rest points, (..., P) -> (..., L)."""
        return np.add.reduceat(of_rest_points, self.first, axis=-1)

    def expression(
        self, G: Sequence[cs.MX], features: cs.MX, betas: cs.MX, offsets: cs.MX | None = None
    ) -> cs.MX:
        """The landmarks in symbols, (3, L) m, before translation; displaced by offsets (3, L) m."""
        P, L = len(self.joint), len(self.first)
        shaped = cs.sparsify(cs.DM(self.shapedirs.T)) @ betas
        bent = cs.sparsify(cs.DM(self.posedirs.T)) @ features[self.used.tolist()]
        rest = cs.reshape(cs.DM(self.template) + shaped + bent, P, 3).T  # (3, P)
        if offsets is not None:
            displaced = csc_array((self.mass, (self.landmark, np.arange(P))), shape=(L, P))
            rest = rest + offsets @ sparse_constant(displaced)
        own = csc_array((np.ones(P), (np.arange(P), self.joint)), shape=(P, len(G)))
        moved = blend_points(rest, cs.DM(self.mass), G, sparse_constant(own))
        edges = np.append(self.first, P)
        means = csc_array((np.ones(P), np.arange(P), edges), shape=(P, L))
        return moved @ sparse_constant(means)
