"""The posed surface and its derivatives by NumPy, chunk by chunk.

The kinematics (`motion`) do not know how many vertices there are, and what is left per vertex is
linear in what they say. With v_i = T_i + S_i betas + P_i f at rest and R_i = sum_j w_ij R_j,

    v'_i = sum_j w_ij G_j v_i
    dv'_i/dpose[k, a] = w_ka x sum_{j at or below k} w_ij (G_j v_i - t_k) + R_i P_ik df/dpose[k, a]
    dv'_i/dbetas[b]   = R_i S_ib + sum_j w_ij dG_j/dbetas[b] v_i

where w_ka is the axis about which the world turns when pose[k, a] grows, and t_k the posed joint
it turns about. Arrays are packed in chunks of vertices that stay in the processor's cache,
coordinates first, so that every operation runs along vertices.

Most joints leave a vertex alone. A chunk therefore holds the posedirs only of those joints that
correct its vertices, and the derivatives by all other joints are zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.forward.motion import JointMotion, MotionDerivatives, PointsAtMotion
from workbench.bodies.forward.named_points import Rows, RowTarget

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

CHUNK = 512  # vertices: measured, and flat from there on
BODIES_AT_ONCE = 96  # bodies in one matrix product, half of 192 walkers: measured, flat from 32 on
WIDTHS = 12, 3, 3  # numbers a vertex: blended motion, rest, moved


@dataclass(frozen=True, eq=False)
class VertexChunk:
    """Some vertices, coordinate by coordinate: n of them, which stand in these `rows` of all.

    `directions` (1 + B + 9 U, 3 n) are template, shapedirs and, from row `edge` = 1 + B on, the
    posedirs of the U joints that correct any of these vertices (`corrected`), by the features that
    are `used` (9 U,). `weights` are (K, n).
    """

    rows: slice
    directions: Array
    edge: int
    weights: Array
    corrected: Index
    used: Index

    @property
    def shapedirs(self) -> Array:
        """The shape directions of these n vertices, (B, 3 n), in metres."""
        return self.directions[1 : self.edge]

    @property
    def posedirs(self) -> Array:
        """The pose directions of these n vertices by used features, (9 U, 3 n), in metres."""
        return self.directions[self.edge :]

    @property
    def columns(self) -> slice:
        """Where these vertices' coordinates stand among all."""
        return slice(3 * self.rows.start, 3 * self.rows.stop)

    def rest(self, betas: Array, features: Array) -> Array:
        """T + S betas + P f, (..., 3, n), for betas (..., B) and features (..., 9 (K - 1))."""
        ones = np.ones((*betas.shape[:-1], 1))
        along = np.concatenate([ones, betas, features[..., self.used]], axis=-1)
        flat = along @ self.directions  # in one product, which reads memory in order
        return np.asarray(flat.reshape(*flat.shape[:-1], 3, -1))

    def blended(self, motion: JointMotion) -> Array:
        """sum_j w_j G_j, (3, 4, n)."""
        K, n = self.weights.shape
        return np.asarray((motion.G.reshape(K, 12).T @ self.weights).reshape(3, 4, n))


def chunks_of(arrays: SkinnedBody, vertices: slice | list[int]) -> list[VertexChunk]:
    """A body's vertices, or some of them, in order.

    The directions of all chunks stand in one array, one chunk after the other. NumPy asks the
    system for large pages for it, and the processor reads such memory half as fast again.
    """
    chosen = np.arange(len(arrays.template))[vertices]
    pieces = [chosen[first : first + CHUNK] for first in range(0, len(chosen), CHUNK)]
    acting = [arrays.posedirs[rows].any(axis=(0, 1)).reshape(-1, 9) for rows in pieces]
    corrected = [1 + np.flatnonzero(features.any(axis=1)) for features in acting]  # no root
    edge = 1 + arrays.shapedirs.shape[2]
    sizes = [3 * len(r) * (edge + 9 * len(b)) for r, b in zip(pieces, corrected, strict=True)]
    every, ends = np.empty(sum(sizes)), accumulate(sizes)
    packed: list[VertexChunk] = []
    for rows, joints, size, end in zip(pieces, corrected, sizes, ends, strict=True):
        directions, n = every[end - size : end].reshape(-1, 3 * len(rows)), len(rows)
        used = (9 * (joints[:, None] - 1) + np.arange(9)).ravel()
        directions[0] = arrays.template[rows].T.ravel()
        directions[1:edge] = arrays.shapedirs[rows].transpose(2, 1, 0).reshape(edge - 1, 3 * n)
        directions[edge:] = arrays.posedirs[rows][:, :, used].transpose(2, 1, 0).reshape(-1, 3 * n)
        places = slice(CHUNK * len(packed), CHUNK * len(packed) + n)
        weights = np.ascontiguousarray(arrays.weights[rows].T)
        packed.append(VertexChunk(places, directions, edge, weights, joints, used))
    return packed


@dataclass(frozen=True, eq=False)
class NumpyMesh:
    """The surface by NumPy, chunk after chunk."""

    chunks: list[VertexChunk]
    parents: tuple[int, ...]

    def at(self, motion: JointMotion, betas: Array) -> NumpyMeshAt:
        """The surface moved by a motion, of the person with these betas (B,)."""
        return NumpyMeshAt(self, motion, betas)


@dataclass(frozen=True, eq=False)
class NumpyMeshAt(PointsAtMotion):
    """The vertices at one motion and shape, before translation."""

    of: NumpyMesh
    motion: JointMotion
    betas: Array
    _rest: dict[int, Array] = field(default_factory=dict)  # by the chunk's first vertex

    @cached_property
    def points(self) -> Array:
        """The posed vertices before translation, (N, 3) m."""
        chunks = self.of.chunks
        points = np.empty((chunks[-1].rows.stop if chunks else 0, 3))
        for chunk in chunks:
            M = chunk.blended(self.motion)
            moved = np.einsum("dcn,cn->dn", M[:, :3], self._rest_of(chunk)) + M[:, 3]
            points[chunk.rows] = moved.T
        return points

    def write_jacobian(
        self, by: MotionDerivatives, into: Mapping[str, RowTarget], scale: Array | None
    ) -> None:
        """The points' derivative by `pose`, `betas` and `trans`, as far as `into` has them.

        into[name] (size, 3 N) receives it transposed, each column times scale (3 N,).
        """
        for chunk in self.of.chunks:
            n = chunk.weights.shape[1]
            R = chunk.blended(self.motion)[:, :3]
            factor = None if scale is None else scale[chunk.columns].reshape(n, 3).T
            if "pose" in into:
                below = _below(chunk, self._rest_of(chunk), self.motion, self.of.parents)
                _write(into["pose"], chunk.columns, _by_pose(chunk, below, R, by), factor)
            if "betas" in into:
                _write(into["betas"], chunk.columns, _by_betas(chunk, R, by), factor)
            if "trans" in into:
                unit = np.repeat(np.eye(3)[:, :, None], n, axis=2)
                _write(into["trans"], chunk.columns, unit, factor)

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """The gradients of cotangent (N, 3) . points by G (K, 3, 4), features and betas."""
        motion, K = self.motion, len(self.motion.G)
        on_G, on_features = np.zeros((K, 12)), np.zeros_like(motion.features)
        on_betas = np.zeros_like(self.betas)
        for chunk in self.of.chunks:
            n = chunk.weights.shape[1]
            p = np.ascontiguousarray(cotangent[chunk.rows].T)  # (3, n)
            outer = np.empty((3, 4, n))
            np.multiply(p[:, None], self._rest_of(chunk)[None], out=outer[:, :3])
            outer[:, 3] = p
            on_G += chunk.weights @ outer.reshape(12, n).T
            on_rest = np.einsum("dcn,dn->cn", chunk.blended(motion)[:, :3], p).reshape(-1)
            on_features[chunk.used] += chunk.posedirs @ on_rest
            on_betas += chunk.shapedirs @ on_rest
        return on_G.reshape(K, 3, 4), on_features, on_betas

    def _rest_of(self, chunk: VertexChunk) -> Array:
        """The vertices of a chunk at rest, (3, n), computed once."""
        first = chunk.rows.start
        if first not in self._rest:
            self._rest[first] = chunk.rest(self.betas, self.motion.features)
        return self._rest[first]


def batch_points(chunks: list[VertexChunk], motions: JointMotion, betas: Array) -> Array:
    """The vertices (M, N, 3) m for M motions and betas (M, B).

    Before translation, by matrix products over many of them at a time.
    """
    G, features = motions.G, motions.features
    points = np.empty((len(G), chunks[-1].rows.stop if chunks else 0, 3))
    widest = max((chunk.weights.shape[1] for chunk in chunks), default=0)
    # memory that is used again: new pages for every product would cost half as much as it
    buffers = [np.empty(min(BODIES_AT_ONCE, len(G)) * wide * widest) for wide in WIDTHS]
    along = np.concatenate([np.ones((len(G), 1)), betas, features], axis=1)
    ahead = np.arange(1 + betas.shape[1])  # of the features
    for first in range(0, len(G), BODIES_AT_ONCE):
        bodies = slice(first, first + BODIES_AT_ONCE)
        turned = G[bodies].transpose(0, 2, 3, 1).reshape(-1, G.shape[1])  # (12 m, K)
        m = len(turned) // 12
        for chunk in chunks:
            n = chunk.weights.shape[1]
            parts = (buffer[: m * wide * n] for buffer, wide in zip(buffers, WIDTHS, strict=True))
            M, rest, moved = (part.reshape(m, -1, n) for part in parts)
            np.matmul(turned, chunk.weights, out=M.reshape(12 * m, n))
            coefficients = along[bodies][:, np.append(ahead, len(ahead) + chunk.used)]
            np.matmul(coefficients, chunk.directions, out=rest.reshape(m, 3 * n))
            blended = M.reshape(m, 3, 4, n)
            np.einsum("mdcn,mcn->mdn", blended[:, :, :3], rest, out=moved)
            moved += blended[:, :, 3]
            points[bodies, chunk.rows] = moved.transpose(0, 2, 1)
    return points


def _below(chunk: VertexChunk, rest: Array, motion: JointMotion, parents: tuple[int, ...]) -> Array:
    """sum_{j at or below k} w_ij (G'_j v_i - t_k), (K, 3, n) m."""
    K, n = chunk.weights.shape
    y = (motion.G[:, :, :3].reshape(3 * K, 3) @ rest).reshape(K, 3, n)
    y += motion.G[:, :, 3, None]
    y *= chunk.weights[:, None]
    share = chunk.weights.copy()
    for k in range(K - 1, 0, -1):  # children come after their parents
        y[parents[k]] += y[k]
        share[parents[k]] += share[k]
    y -= share[:, None] * motion.joints[:, :, None]
    return y


def _by_pose(chunk: VertexChunk, below: Array, R: Array, by: MotionDerivatives) -> Array:
    """The transposed derivative of n vertices by the pose, (3 K, 3, n)."""
    K, n = chunk.weights.shape
    planar: Array = np.matmul(by.turns, below).reshape(3 * K, 3, n)
    if U := len(chunk.corrected):
        d_features = by.d_features[chunk.corrected].swapaxes(1, 2)
        d_rest = np.matmul(d_features, chunk.posedirs.reshape(U, 9, 3 * n))
        turned = np.einsum("dcn,kcn->kdn", R, d_rest.reshape(3 * U, 3, n))
        planar.reshape(K, 3, 3, n)[chunk.corrected] += turned.reshape(U, 3, 3, n)
    return planar


def _by_betas(chunk: VertexChunk, R: Array, by: MotionDerivatives) -> Array:
    """The transposed derivative of n vertices by betas, (B, 3, n)."""
    B, n = len(chunk.shapedirs), chunk.weights.shape[1]
    d_shift = by.d_shift.swapaxes(1, 2).reshape(3 * B, len(chunk.weights))
    planar: Array = (d_shift @ chunk.weights).reshape(B, 3, n)
    planar += np.einsum("dcn,kcn->kdn", R, chunk.shapedirs.reshape(B, 3, n))  # along n: in one pass
    return planar


def _write(into: RowTarget, columns: slice, values: Array, factor: Array | None) -> None:
    """Planar (k, 3, n), which is used up, into columns of k rows, vertex by vertex."""
    if factor is not None:
        values *= factor
    if isinstance(into, Rows):
        target, values = into.array[:, columns], values[into.rows]
    else:
        target = into[:, columns]
    for d in range(3):  # one coordinate at a time, so that the inner loop runs along vertices
        target[:, d::3] = values[:, d]
