"""The points of a triangle body: in symbols, and as sources of points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import prod

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, kron

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.functions import sparse_constant
from workbench.bodies.body import regressed
from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.forward.named_points import (
    BlockPoints,
    BodyPoints,
    BodyPointsAt,
    RowTarget,
    write,
)
from workbench.bodies.forward.sources import Arguments, BodySource
from workbench.bodies.triangles.numbers import PackedTriangles, TriangleNumbers, TriangleSurface


def posed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, trans: cs.MX, free: Mapping[str, Block]
) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m.

    `template`, `shapedirs` and `posedirs` that are free are symbols, all others are numbers.
    """
    N = of.stitching.n_vertices
    right_side = cs.MX.zeros(N, 3)
    for i, edges in enumerate(deformed(of, pose, betas, free)):
        right_side += _edges(of, i).T @ edges
    V = of.stitching.solve_symbolic(right_side)
    root = cs.MX(sparse_constant(of.root_row))
    shift = root @ _array(of, "template", free).T + trans.T - root @ V  # (1, 3)
    return (V + cs.repmat(shift, N, 1)).T


def deformed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, free: Mapping[str, Block]
) -> tuple[cs.MX, cs.MX]:
    """The edges X_f e_f0 and X_f e_f1 before they are stitched, (F, 3) m each.

    Arrays that are free are symbols, as in `posed`.
    """
    F, J = of.near.shape
    R = world_rotations(pose, of.parents)  # (3, 3) each
    # faces run down the rows; of a 3 x 3 matrix B[:, 3 c + r] is row r, column c
    B = cs.MX(sparse_constant(of.weights)) @ cs.vertcat(*[cs.vec(R_k).T for R_k in R])
    shaped = _array(of, "shapedirs", free).T @ betas
    D = _identities(F) + cs.reshape(shaped, 9, F).T  # D[:, 3 r + c]
    twists = cs.reshape(pose[:, of.near.ravel().tolist()], 3 * J, F)  # of each face
    each = cs.reshape(cs.repmat(twists, 9, 1), 3 * J, 9 * F)  # once for each entry of its matrix
    bent = cs.sum1(_array(of, "posedirs", free) * each)
    Q = _identities(F) + cs.reshape(bent, 9, F).T  # Q[:, 3 r + c]
    found = []
    for i in range(2):
        e = _edges(of, i) @ _array(of, "template", free).T  # (F, 3)
        for M in (Q, D):
            e = cs.horzcat(*[cs.sum2(M[:, 3 * r : 3 * r + 3] * e) for r in range(3)])
        found.append(cs.horzcat(*[cs.sum2(B[:, [r, 3 + r, 6 + r]] * e) for r in range(3)]))
    return found[0], found[1]


def _edges(of: PackedTriangles, i: int) -> cs.MX:
    """The matrix (F, N) from vertices to edge i of every face."""
    return cs.MX(sparse_constant(of.stitching.A[i::2]))


def _array(of: PackedTriangles, name: str, free: Mapping[str, Block]) -> cs.MX:
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
    at: Arguments,
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
        vertices = posed(numbers.packed, *at.symbols, free)
        return vertices if regressor is None else vertices @ cs.MX(sparse_constant(regressor.T))

    arithmetic = numbers if regressor is None else NumericMeans(numbers, regressor)
    return BodySource(
        at,
        at.body.n_vertices if names is None else len(names),
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
