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

from workbench.arrays import Array
from workbench.bodies.forward.motion import JointMotion
from workbench.bodies.forward.named_points import BodyPoints, BodyPointsAt
from workbench.bodies.forward.rows import RowTarget, write
from workbench.bodies.triangles.many import ManySurfaces
from workbench.bodies.triangles.packed import PackedTriangles


@dataclass(frozen=True, eq=False)
class TriangleArithmetic(BodyPoints):
    """The vertices of a triangle body by arithmetic; see BodyPoints."""

    packed: PackedTriangles

    def evaluate(
        self, pose: Array, betas: Array, trans: Array | None = None, *_: Array
    ) -> SurfaceNumbers:
        """The surface at pose (K, 3) rad, betas (B,) and trans (3,) m, zero if it is not given."""
        return SurfaceNumbers(self.packed, pose, betas, np.zeros(3) if trans is None else trans)

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *_: Array) -> Array:
        """The vertices (M, N, 3) m of M poses, betas and translations, all at once."""
        return self._many(poses, betas) + trans[:, None]

    @cached_property
    def _many(self) -> ManySurfaces:
        return ManySurfaces(self.packed)


@dataclass(frozen=True, eq=False)
class SurfaceNumbers(BodyPointsAt):
    """The surface at one pose (K, 3) rad, betas (B,) and trans (3,) m; see BodyPointsAt."""

    of: PackedTriangles
    pose: Array
    betas: Array
    trans: Array

    @cached_property
    def motion(self) -> JointMotion:
        """The kinematics, of which rotations alone are read."""
        return self.of.kinematics.motion_kept(self.pose, np.zeros(0))

    @property
    def rotations(self) -> Array:
        """The rotation R of each joint in the world, (K, 3, 3)."""
        return self.motion.G[:, :, :3]

    @cached_property
    def B(self) -> Array:
        """The blended rotations (F, 3, 3)."""
        R = self.rotations.reshape(-1, 9)
        return np.asarray(self.of.weights @ R).reshape(-1, 3, 3)

    @cached_property
    def D(self) -> Array:
        """D = I + shapedirs betas, which says who the person is, (F, 3, 3)."""
        moved = self.of.shape_columns @ self.betas
        return np.eye(3) + np.asarray(moved).reshape(-1, 3, 3)

    @cached_property
    def twists(self) -> Array:
        """The twists of the joints that each face feels, (F, 3 J) rad."""
        near = self.of.near
        return np.asarray(self.pose[near].reshape(len(near), 3 * near.shape[1]))

    @cached_property
    def bent(self) -> Array:
        """Q e, its edges as rows: (F, 2, 3) m."""
        moved: Array = np.einsum("fiaj,fj->fia", self.of.bends, self.twists)
        return self.of.edges + moved

    @cached_property
    def shaped(self) -> Array:
        """The edges D Q e of the bent person before the parts turn, (F, 2, 3) m."""
        return _on_edges(self.D, self.bent)

    @property
    def deformations(self) -> Array:
        """The deformation X = B D Q of each triangle, (F, 3, 3)."""
        Q = np.eye(3) + np.einsum("facj,fj->fac", self.of.posedirs, self.twists)
        return np.asarray(self.B @ self.D @ Q)

    @cached_property
    def points(self) -> Array:
        """The stitched vertices, (N, 3) m."""
        of = self.of
        cotangents = of.stitching.pulled(_on_edges(self.B, self.shaped))
        return np.asarray(of.placed(cotangents) + of.root + self.trans)

    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and `trans`, (size, 3 N) each."""
        N = self.of.stitching.n_vertices
        cotangents = []
        if "pose" in into:
            cotangents += [
                cotangent for k in range(len(self.pose)) for cotangent in self._by_joint(k)
            ]
        if "betas" in into:
            cotangents += self._by_betas()
        if cotangents:
            moved = self.of.placed(np.concatenate(cotangents, axis=1))
            columns = (
                moved.reshape(N, len(cotangents), 3)
                .transpose(1, 0, 2)
                .reshape(len(cotangents), 3 * N)
            )
            here = len(into["pose"]) if "pose" in into else 0
            for name, rows in (("pose", columns[:here]), ("betas", columns[here:])):
                if name in into:
                    write(into[name], rows, scale)
        if "trans" in into:
            write(into["trans"], np.tile(np.eye(3), N), scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 N,) . points by `pose`, `betas` and `trans`, flat."""
        of, on_points = self.of, cotangent.reshape(-1, 3)
        on_trans = on_points.sum(axis=0)
        freed = on_points - of.root_row.T @ on_trans[None]  # placed, transposed
        on_edges = (of.stitching.A @ of.stitching.solve(np.asarray(freed))).reshape(-1, 2, 3)
        on_B = on_edges.transpose(0, 2, 1) @ self.shaped
        on_shaped = on_edges @ self.B
        on_D = on_shaped.transpose(0, 2, 1) @ self.bent
        on_twists = np.einsum("fia,fiaj->fj", on_shaped @ self.D, of.bends, optimize=True)
        on_G = np.zeros((len(self.pose), 3, 4))
        on_G[:, :, :3] = np.asarray(of.weights.T @ on_B.reshape(-1, 9)).reshape(-1, 3, 3)
        on_pose, _ = self.motion.vjp(on_G, np.zeros_like(self.motion.features))
        np.add.at(on_pose, of.near, on_twists.reshape(*of.near.shape, 3))
        on_betas = on_D.ravel() @ of.shape_columns
        return {"pose": on_pose.ravel(), "betas": on_betas, "trans": on_trans}

    def _by_joint(self, k: int) -> list[Array]:
        """What each of pose[k]'s three numbers cotangents at the vertices, (N, 3)."""
        limb, turns = self.of.limbs[k], self.motion.derivatives.turns[k].reshape(3, 3, 3)
        R = self.rotations[limb.joints].reshape(-1, 9)
        B = np.asarray(limb.weights @ R).reshape(-1, 3, 3)
        hanging = _on_edges(B, self.shaped[limb.faces])
        G = limb.onto_vertices @ hanging.reshape(-1, 3)  # (N, 3)
        cotangents = [G @ turn.T for turn in turns]
        if len(limb.bent):
            BD = (self.B[limb.bent] @ self.D[limb.bent])[:, None]  # (n, 1, 3, 3)
            bends = self.of.bends.reshape(*self.of.edges.shape, self.of.near.shape[1], 3)
            by_twist = BD @ bends[limb.bent, :, :, limb.slot]  # (n, 2, 3, axis)
            for axis in range(3):
                cotangents[axis] += limb.bent_onto_vertices @ by_twist[..., axis].reshape(-1, 3)
        return cotangents

    def _by_betas(self) -> list[Array]:
        """What each beta cotangents at the vertices, (N, 3)."""
        moved = np.moveaxis(self.of.shapedirs, 3, 0)  # (B, F, 3, 3)
        return [
            self.of.stitching.pulled(_on_edges(self.B, _on_edges(one, self.bent))) for one in moved
        ]


def _on_edges(matrices: Array, edges: Array) -> Array:
    """M_f e_fi, for matrices (F, 3, 3) and edges (F, 2, 3)."""
    return np.asarray(np.einsum("fab,fib->fia", matrices, edges))
