"""A triangle body in symbols: from pose, betas and trans to its stitched vertices."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.triangles.packed import PackedTriangles


def posed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, trans: cs.MX, free: Mapping[str, Block]
) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m.

    `template`, `shapedirs` and `posedirs` that are free are symbols, all others are numbers.
    """
    N = of.stitching.n_vertices
    cotangents = cs.MX.zeros(N, 3)
    for i, edges in enumerate(deformed(of, pose, betas, free)):
        cotangents += _edges(of, i).T @ edges
    V = of.stitching.solve_symbolic(cotangents)
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
    return free[name].symbol if name in free else _as_symbol(getattr(of, name))


def _as_symbol(array: Array) -> cs.MX:
    """An array as the symbol of a block of its shape has it: the axes reversed."""
    rows, columns = prod(array.shape[:-1]), array.shape[-1]
    return cs.MX(cs.sparsify(cs.DM(array.reshape(rows, columns).T)))


def _identities(count: int) -> cs.MX:
    """The 3 x 3 identity in each of so many rows."""
    return cs.MX(cs.DM(np.tile(np.eye(3).ravel(), (count, 1))))
