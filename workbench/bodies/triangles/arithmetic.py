"""A triangle body in numbers: the stitched surface, its derivative, and back.

    V = L A' (B D Q e),        L the factorised stitching, A' from edges to vertices.

All but L is done triangle by triangle. A turn of joint k multiplies what hangs on k from the left
by one matrix for all triangles; twists and betas change each triangle in its own way. The
derivative's columns are dense all the same: L spreads every change over the whole mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.bodies.triangles.turning import Turning
from workbench.geometry.triangles import edges


@dataclass(frozen=True, eq=False)
class Limb:
    """What joint k turns: the faces with a weight on it or below, and those that feel its twist."""

    joints: Index  # k and all below it
    faces: Index
    weights: csr_array  # of these faces on those joints
    onto_vertices: csr_array  # (N, 2 n) of these faces' edges
    bent: Index  # faces near k
    slot: Index  # which of their near joints k is
    bent_onto_vertices: csr_array


class Arithmetic:
    """The arrays of a body packed for arithmetic; `at` a pose and shape, all else follows."""

    def __init__(self, body: TriangleArrays) -> None:
        self.stitching, self.weights = body.stitching, body.weights
        self.shapedirs, self.posedirs, self.near = body.shapedirs, body.posedirs, body.near
        self.shape_columns = body.shapedirs.reshape(9 * body.n_faces, body.n_betas)
        self.turning = Turning(body.parents)
        self.root_row = body.J_regressor[[0]]
        self.root = np.asarray(self.root_row @ body.template).ravel()  # (3,) m
        self.edges = edges(body.template, body.faces)  # (F, 2, 3) m
        # posedirs on the edges: what a radian of each twist adds to Q e, (F, 2, 3, 3 J)
        self.bends = np.einsum("facj,fic->fiaj", body.posedirs, self.edges, optimize=True)
        self.parents = body.parents

    @cached_property
    def limbs(self) -> list[Limb]:
        """One per joint."""
        K = len(self.parents)
        below: list[list[int]] = [[k] for k in range(K)]
        for k in range(K - 1, 0, -1):
            below[self.parents[k]] += below[k]
        A_t, columns, found = self.stitching.A.T.tocsc(), self.weights.tocsc(), []
        for k in range(K):
            faces = np.unique(columns[:, sorted(below[k])].indices).astype(np.int64)
            bent, slot = np.nonzero(self.near == k)
            sides = (csr_array(A_t[:, _edges_of(some)].tocsr()) for some in (faces, bent))
            joints = np.array(sorted(below[k]))
            weights = csr_array(self.weights[faces][:, joints])
            found.append(Limb(joints, faces, weights, next(sides), bent, slot, next(sides)))
        return found

    def at(self, pose: Array, betas: Array) -> SurfaceNumbers:
        """At pose (K, 3) rad and betas (B,)."""
        return SurfaceNumbers(self, pose, betas)

    def placed(self, pulls: Array) -> Array:
        """The vertices (N, k) that answer to pulls (N, k), the root joint at zero."""
        V = self.stitching.solve(pulls)
        return np.asarray(V - self.root_row @ V)


@dataclass(frozen=True, eq=False)
class SurfaceNumbers:
    """The surface at one pose (K, 3) and betas (B,), before translation."""

    of: Arithmetic
    pose: Array
    betas: Array

    @cached_property
    def rotations(self) -> tuple[Array, Array]:
        """R (K, 3, 3) and turns (K, 3, 3, 3); see Turning."""
        return self.of.turning.at(self.pose)

    @cached_property
    def B(self) -> Array:
        """The blended rotations (F, 3, 3)."""
        R = self.rotations[0]
        return np.asarray(self.of.weights @ R.reshape(len(R), 9)).reshape(-1, 3, 3)

    @cached_property
    def D(self) -> Array:
        """Who it is, (F, 3, 3)."""
        moved = self.of.shape_columns @ self.betas
        return np.eye(3) + np.asarray(moved).reshape(-1, 3, 3)

    @cached_property
    def twists(self) -> Array:
        """(F, 3 J): what each face feels, rad."""
        near = self.of.near
        return np.asarray(self.pose[near].reshape(len(near), 3 * near.shape[1]))

    @cached_property
    def bent(self) -> Array:
        """Q e, its edges as rows: (F, 2, 3) m."""
        moved: Array = np.einsum("fiaj,fj->fia", self.of.bends, self.twists)
        return self.of.edges + moved

    @cached_property
    def shaped(self) -> Array:
        """D Q e, (F, 2, 3) m."""
        return _each(self.D, self.bent)

    @property
    def deformations(self) -> Array:
        """X = B D Q, (F, 3, 3)."""
        Q = np.eye(3) + np.einsum("facj,fj->fac", self.of.posedirs, self.twists)
        return np.asarray(self.B @ self.D @ Q)

    @cached_property
    def points(self) -> Array:
        """The stitched vertices, (N, 3) m."""
        of = self.of
        pulls = of.stitching.pulled(_each(self.B, self.shaped))
        return np.asarray(of.placed(pulls) + of.root)

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write into `pose` (3 K, 3 N), `betas` and `trans`, each column times scale (3 N,)."""
        N = self.of.stitching.n_vertices
        pulls = []
        if "pose" in into:
            pulls += [pull for k in range(len(self.pose)) for pull in self._by_joint(k)]
        if "betas" in into:
            pulls += self._by_betas()
        if pulls:
            moved = self.of.placed(np.concatenate(pulls, axis=1))
            columns = moved.reshape(N, len(pulls), 3).transpose(1, 0, 2).reshape(len(pulls), 3 * N)
            here = len(into["pose"]) if "pose" in into else 0
            for name, rows in (("pose", columns[:here]), ("betas", columns[here:])):
                if name in into:
                    np.multiply(rows, 1.0 if scale is None else scale, out=into[name])
        if "trans" in into:
            unit = np.tile(np.eye(3), N)
            np.multiply(unit, 1.0 if scale is None else scale, out=into["trans"])

    def adjoint(self, pull: Array) -> tuple[Array, Array]:
        """Gradients (K, 3) and (B,) of sum(pull * points), pull (N, 3)."""
        of = self.of
        freed = pull - of.root_row.T @ pull.sum(axis=0, keepdims=True)  # placed, transposed
        on_edges = (of.stitching.A @ of.stitching.solve(np.asarray(freed))).reshape(-1, 2, 3)
        on_B = on_edges.transpose(0, 2, 1) @ self.shaped
        on_shaped = on_edges @ self.B
        on_D = on_shaped.transpose(0, 2, 1) @ self.bent
        on_twists = np.einsum("fia,fiaj->fj", on_shaped @ self.D, of.bends, optimize=True)
        on_R = np.asarray(of.weights.T @ on_B.reshape(-1, 9)).reshape(-1, 3, 3)
        on_pose = of.turning.adjoint(self.pose, on_R)
        np.add.at(on_pose, of.near, on_twists.reshape(*of.near.shape, 3))
        return on_pose, on_D.ravel() @ of.shape_columns

    def _by_joint(self, k: int) -> list[Array]:
        """What each of pose[k]'s three numbers pulls at the vertices, (N, 3)."""
        limb, R, turns = self.of.limbs[k], self.rotations[0], self.rotations[1][k]
        B = np.asarray(limb.weights @ R[limb.joints].reshape(-1, 9)).reshape(-1, 3, 3)
        hanging = _each(B, self.shaped[limb.faces])
        G = limb.onto_vertices @ hanging.reshape(-1, 3)  # (N, 3)
        pulls = [G @ turn.T for turn in turns]
        if len(limb.bent):
            BD = (self.B[limb.bent] @ self.D[limb.bent])[:, None]  # (n, 1, 3, 3)
            bends = self.of.bends.reshape(*self.of.edges.shape, self.of.near.shape[1], 3)
            by_twist = BD @ bends[limb.bent, :, :, limb.slot]  # (n, 2, 3, axis)
            for axis in range(3):
                pulls[axis] += limb.bent_onto_vertices @ by_twist[..., axis].reshape(-1, 3)
        return pulls

    def _by_betas(self) -> list[Array]:
        """What each beta pulls at the vertices, (N, 3)."""
        moved = np.moveaxis(self.of.shapedirs, 3, 0)  # (B, F, 3, 3)
        return [self.of.stitching.pulled(_each(self.B, _each(one, self.bent))) for one in moved]


def _each(matrices: Array, edges: Array) -> Array:
    """M_f e_fi, for matrices (F, 3, 3) and edges (F, 2, 3)."""
    return np.asarray(np.einsum("fab,fib->fia", matrices, edges))


def _edges_of(faces: Index) -> Index:
    return (2 * faces[:, None] + np.arange(2)).ravel()
