"""A triangle body's stitched surface: in numbers, with its derivative and back, and in symbols.

    V = L A' (B D Q e),        L the factorised stitching, A' from edges to vertices.

All but L is done triangle by triangle. A turn of joint k multiplies what hangs on k from the left
by one matrix for all triangles; twists and betas change each triangle in its own way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, kron

from workbench.arrays import Array, Index
from workbench.blocks import Block
from workbench.blocks.functions import sparse_constant
from workbench.bodies.body import regressed
from workbench.bodies.forward import kinematics
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.named_points import (
    BlockPoints,
    BodyPoints,
    BodyPointsAt,
    RowTarget,
    write,
)
from workbench.bodies.forward.posing import axial, world_rotations
from workbench.bodies.forward.sources import Arguments, BodySource
from workbench.geometry.rotation import crossed, left_jacobian, matrix_from_vector
from workbench.geometry.triangles import edges

if TYPE_CHECKING:
    from workbench.bodies.triangles.body import TriangleBody


@dataclass(frozen=True, eq=False)
class JointReach:
    """What joint k turns: the n faces with a weight on it or below, the m that feel its twist.

    `joints` are k and all below it, `slot` (m,) which of the near joints k is; `onto_vertices`
    (N, 2 n) and `bent_onto_vertices` (N, 2 m) go from the edges of these faces to vertices.
    """

    joints: Index
    faces: Index
    weights: csr_array
    onto_vertices: csr_array
    bent: Index
    slot: Index
    bent_onto_vertices: csr_array


class PackedTriangles:
    """The arrays of a triangle body, in the order that arithmetic needs."""

    def __init__(self, body: TriangleBody) -> None:
        self.stitching, self.weights, self.parents = body.stitching, body.weights, body.parents
        self.template = body.template
        self.shapedirs, self.posedirs, self.near = body.shapedirs, body.posedirs, body.near
        self.shape_columns = body.shapedirs.reshape(9 * body.n_faces, body.n_betas)
        self.ancestors = ancestors(body.parents)
        self.root_row = body.J_regressor[[0]]
        self.root = np.asarray(self.root_row @ body.template).ravel()  # (3,) m
        self.edges = edges(body.template, body.faces)  # (F, 2, 3) m
        # posedirs on the edges: what a radian of each twist adds to Q e, (F, 2, 3, 3 J)
        self.bends = np.einsum("facj,fic->fiaj", body.posedirs, self.edges, optimize=True)

    @cached_property
    def reaches(self) -> list[JointReach]:
        """What each joint turns."""
        A_t, columns, reaches = self.stitching.A.T.tocsc(), self.weights.tocsc(), []
        for k in range(len(self.parents)):
            joints = np.flatnonzero(self.ancestors[:, k])
            faces = np.unique(columns[:, joints].indices).astype(np.int64)
            bent, slot = np.nonzero(self.near == k)
            onto, bent_onto = (
                csr_array(A_t[:, (2 * rows[:, None] + np.arange(2)).ravel()].tocsr())
                for rows in (faces, bent)
            )
            weights = csr_array(self.weights[faces][:, joints])
            reaches.append(JointReach(joints, faces, weights, onto, bent, slot, bent_onto))
        return reaches

    def placed(self, right_side: Array) -> Array:
        """The vertices (N, k) that solve the equations of stitching, the root joint at zero."""
        V = self.stitching.solve(right_side)
        return np.asarray(V - self.root_row @ V)


@dataclass(frozen=True, eq=False)
class TriangleNumbers(BodyPoints):
    """The vertices of a triangle body by arithmetic."""

    packed: PackedTriangles

    def evaluate(
        self, pose: Array, betas: Array, trans: Array | None = None, *_: Array
    ) -> TriangleSurface:
        """The surface at pose (K, 3) rad, betas (B,) and trans (3,) m, zero if it is not given."""
        return TriangleSurface(self.packed, pose, betas, np.zeros(3) if trans is None else trans)

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *_: Array) -> Array:
        """The vertices (M, N, 3) m of M poses, betas and translations; stitched all at once."""
        of, pairs = self.packed, zip(poses, betas, strict=True)
        right_sides = [TriangleSurface(of, p, b, np.zeros(3)).right_side for p, b in pairs]
        if not right_sides:
            return np.zeros((0, of.stitching.n_vertices, 3))
        V = of.placed(np.concatenate(right_sides, axis=1)).reshape(-1, len(poses), 3)
        return np.asarray(V.transpose(1, 0, 2) + of.root + trans[:, None])


@dataclass(frozen=True, eq=False)
class TriangleSurface(BodyPointsAt):
    """The surface at one pose (K, 3) rad, betas (B,) and trans (3,) m."""

    of: PackedTriangles
    pose: Array
    betas: Array
    trans: Array

    @cached_property
    def rotations(self) -> Array:
        """The rotation R of each joint in the world, (K, 3, 3)."""
        return world_rotations(matrix_from_vector(self.pose), self.of.parents)

    @cached_property
    def axes(self) -> Array:
        """The axis about which the world turns with each number of the pose, (K, axis, 3)."""
        above = np.concatenate([np.eye(3)[None], self.rotations[list(self.of.parents[1:])]])
        return np.asarray((above @ left_jacobian(self.pose)).swapaxes(1, 2))

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

    @property
    def right_side(self) -> Array:
        """A' (B D Q e): the edges before stitching, summed onto the vertices, (N, 3) m."""
        return self.of.stitching.edge_sums(_on_edges(self.B, self.shaped))

    @cached_property
    def points(self) -> Array:
        """The stitched vertices, (N, 3) m."""
        return np.asarray(self.of.placed(self.right_side) + self.of.root + self.trans)

    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and `trans`, (size, 3 N) each."""
        N = self.of.stitching.n_vertices
        right_sides = {
            "pose": [one for k in range(len(self.pose)) for one in self._by_joint(k)]
            if "pose" in into
            else [],
            "betas": self._by_betas() if "betas" in into else [],
        }
        every = [one for some in right_sides.values() for one in some]
        if every:
            moved = self.of.placed(np.concatenate(every, axis=1)).reshape(N, len(every), 3)
            rows = moved.transpose(1, 0, 2).reshape(len(every), 3 * N)
            split = len(right_sides["pose"])
            for name, some in (("pose", rows[:split]), ("betas", rows[split:])):
                if name in into:
                    write(into[name], some, scale)
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
        on_R = np.asarray(of.weights.T @ on_B.reshape(-1, 9)).reshape(-1, 3, 3)
        torque = of.ancestors.T @ axial(on_R, self.rotations)  # of all that hangs on a joint
        on_pose = np.einsum("kad,kd->ka", self.axes, torque)
        np.add.at(on_pose, of.near, on_twists.reshape(*of.near.shape, 3))
        on_betas = on_D.ravel() @ of.shape_columns
        return {"pose": on_pose.ravel(), "betas": on_betas, "trans": on_trans}

    def _by_joint(self, k: int) -> list[Array]:
        """The right sides (N, 3) for the derivatives by pose[k]'s three numbers."""
        reach = self.of.reaches[k]
        R = self.rotations[reach.joints].reshape(-1, 9)
        B = np.asarray(reach.weights @ R).reshape(-1, 3, 3)
        hanging = _on_edges(B, self.shaped[reach.faces])
        G = reach.onto_vertices @ hanging.reshape(-1, 3)  # (N, 3)
        right_sides = [G @ turn.T for turn in crossed(self.axes[k])]
        if len(reach.bent):
            BD = (self.B[reach.bent] @ self.D[reach.bent])[:, None]  # (n, 1, 3, 3)
            bends = self.of.bends.reshape(*self.of.edges.shape, self.of.near.shape[1], 3)
            by_twist = BD @ bends[reach.bent, :, :, reach.slot]  # (n, 2, 3, axis)
            for axis in range(3):
                right_sides[axis] += reach.bent_onto_vertices @ by_twist[..., axis].reshape(-1, 3)
        return right_sides

    def _by_betas(self) -> list[Array]:
        """The right sides (N, 3) for the derivatives by each of the betas."""
        directions = np.moveaxis(self.of.shapedirs, 3, 0)  # (B, F, 3, 3)
        return [
            self.of.stitching.edge_sums(_on_edges(self.B, _on_edges(direction, self.bent)))
            for direction in directions
        ]


def _on_edges(matrices: Array, edges: Array) -> Array:
    """M_f e_fi, for matrices (F, 3, 3) and edges (F, 2, 3)."""
    return np.asarray(np.einsum("fab,fib->fia", matrices, edges))


def posed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, trans: cs.MX, free: Mapping[str, Block]
) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m.

    `template`, `shapedirs` and `posedirs` that are free are symbols, all others are numbers.
    """
    N = of.stitching.n_vertices
    right_side = cs.MX.zeros(N, 3)
    for i, moved in enumerate(deformed(of, pose, betas, free)):
        right_side += _edge_matrix(of, i).T @ moved
    V = of.stitching.solve_symbolic(right_side)
    root = cs.MX(sparse_constant(of.root_row))
    shift = root @ _symbol_or_numbers(of, "template", free).T + trans.T - root @ V  # (1, 3)
    return (V + cs.repmat(shift, N, 1)).T


def deformed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, free: Mapping[str, Block]
) -> tuple[cs.MX, cs.MX]:
    """The edges X_f e_f0 and X_f e_f1 before they are stitched, (F, 3) m each.

    Arrays that are free are symbols, as in `posed`.
    """
    F, J = of.near.shape
    R = kinematics.world_rotations(pose, of.parents)  # (3, 3) each
    # faces run down the rows; of a 3 x 3 matrix B[:, 3 c + r] is row r, column c
    B = cs.MX(sparse_constant(of.weights)) @ cs.vertcat(*[cs.vec(R_k).T for R_k in R])
    shaped = _symbol_or_numbers(of, "shapedirs", free).T @ betas
    D = _identities(F) + cs.reshape(shaped, 9, F).T  # D[:, 3 r + c]
    twists = cs.reshape(pose[:, of.near.ravel().tolist()], 3 * J, F)  # of each face
    spread = cs.reshape(cs.repmat(twists, 9, 1), 3 * J, 9 * F)  # once for each entry of a matrix
    bent = cs.sum1(_symbol_or_numbers(of, "posedirs", free) * spread)
    Q = _identities(F) + cs.reshape(bent, 9, F).T  # Q[:, 3 r + c]
    edges = []
    for i in range(2):
        e = _edge_matrix(of, i) @ _symbol_or_numbers(of, "template", free).T  # (F, 3)
        for M in (Q, D):
            e = cs.horzcat(*[cs.sum2(M[:, 3 * r : 3 * r + 3] * e) for r in range(3)])
        edges.append(cs.horzcat(*[cs.sum2(B[:, [r, 3 + r, 6 + r]] * e) for r in range(3)]))
    return edges[0], edges[1]


def _edge_matrix(of: PackedTriangles, i: int) -> cs.MX:
    """The matrix (F, N) from vertices to edge i of every face."""
    return cs.MX(sparse_constant(of.stitching.A[i::2]))


def _symbol_or_numbers(of: PackedTriangles, name: str, free: Mapping[str, Block]) -> cs.MX:
    """An array of the body: the symbol of its block where it is free, its numbers otherwise."""
    if name in free:
        return free[name].symbol
    array = getattr(of, name)
    rows = array.reshape(prod(array.shape[:-1]), array.shape[-1])
    return cs.MX(cs.sparsify(cs.DM(rows.T)))  # as the symbol of a block of its shape has it


def _identities(count: int) -> cs.MX:
    """The 3 x 3 identity in each of so many rows."""
    return cs.MX(cs.DM(np.tile(np.eye(3).ravel(), (count, 1))))


def surface_points(
    arguments: Arguments,
    numbers: TriangleNumbers,
    free: Mapping[str, Block],
    regressor: csr_array | None = None,
    names: tuple[str, ...] | None = None,
) -> BodySource:
    """All vertices of the stitched surface, or means of them by a regressor (M, N) with names.

    In symbols, the stitching's two triangular solves are part of the graph. Where arrays of the
    body are `free`, the symbols are all that there is. Joints of a surface that deforms are on no
    rigid bones.
    """

    def express() -> cs.MX:
        vertices = posed(numbers.packed, *arguments.symbols, free)
        return vertices if regressor is None else vertices @ cs.MX(sparse_constant(regressor.T))

    arithmetic = numbers if regressor is None else NumericMeans(numbers, regressor)
    return BodySource(
        arguments,
        arguments.body.n_vertices if names is None else len(names),
        names,
        tuple(free.values()),
        express,
        lambda maps: None if free else BlockPoints(arithmetic, maps),
        rigid_bones=regressor is None,
    )


@dataclass(frozen=True, eq=False)
class NumericMeans(BodyPoints):
    """Weighted means of the points of a surface, by a regressor (M, N)."""

    surface: TriangleNumbers
    regressor: csr_array

    @cached_property
    def on_coordinates(self) -> csr_array:
        """The matrix of weighted means, for each coordinate: (3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def evaluate(self, pose: Array, betas: Array, trans: Array, *_: Array) -> MeansAt:
        """The means at one pose, betas and translation."""
        return MeansAt(self, self.surface.evaluate(pose, betas, trans))

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *_: Array) -> Array:
        """The means (P, M, 3) m of P poses, betas and translations."""
        return regressed(self.regressor, self.surface.evaluate_batch(poses, betas, trans))


@dataclass(frozen=True, eq=False)
class MeansAt(BodyPointsAt):
    """The means at one pose, betas and trans."""

    of: NumericMeans
    surface: TriangleSurface

    @cached_property
    def points(self) -> Array:
        """The weighted means of the posed vertices, (M, 3) m."""
        return np.asarray(self.of.regressor @ self.surface.points)

    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and `trans`, (size, 3 M) each."""
        N = self.of.regressor.shape[1]
        whole = {name: np.empty((len(target), 3 * N)) for name, target in into.items()}
        self.surface.write_jacobian(whole, None)
        for name, target in into.items():
            write(target, (self.of.on_coordinates @ whole[name].T).T, scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 M,) . points by `pose`, `betas` and `trans`, flat."""
        return self.surface.vjp(self.of.on_coordinates.T @ cotangent)
