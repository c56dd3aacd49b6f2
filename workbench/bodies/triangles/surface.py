"""A triangle body in symbols: from pose, betas and trans to its stitched vertices."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.triangles.packed import PackedTriangles


def posed(
    of: PackedTriangles, pose: cs.MX, betas: cs.MX, trans: cs.MX, free: Mapping[str, Block]
) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m.

    `template`, `shapedirs` and `posedirs` that are free are symbols, all others are numbers.
    """
    F, J = of.near.shape
    N = of.stitching.n_vertices
    template, shapedirs, posedirs = (
        free[name].symbol if name in free else _as_symbol(array)
        for name, array in (
            ("template", of.template),
            ("shapedirs", of.shapedirs),
            ("posedirs", of.posedirs),
        )
    )
    R = world_rotations(pose, of.parents)  # (3, 3) each
    # faces run down the rows; of a 3 x 3 matrix B[:, 3 c + r] is row r, column c
    B = cs.MX(cs.DM(of.weights.tocsc())) @ cs.vertcat(*[cs.vec(R_k).T for R_k in R])
    D = _identities(F) + cs.reshape(shapedirs.T @ betas, 9, F).T  # D[:, 3 r + c]
    twists = cs.reshape(pose[:, of.near.ravel().tolist()], 3 * J, F)  # of each face
    each = cs.reshape(cs.repmat(twists, 9, 1), 3 * J, 9 * F)  # once for each entry of its matrix
    Q = _identities(F) + cs.reshape(cs.sum1(posedirs * each), 9, F).T  # Q[:, 3 r + c]
    pulls = cs.MX.zeros(N, 3)
    for i in range(2):
        A = cs.MX(cs.DM(csc_array(of.stitching.A[i::2].tocsc())))
        e = A @ template.T  # (F, 3)
        for M in (Q, D):
            e = cs.horzcat(*[cs.sum2(M[:, 3 * r : 3 * r + 3] * e) for r in range(3)])
        x = [cs.sum2(B[:, [r, 3 + r, 6 + r]] * e) for r in range(3)]
        pulls += A.T @ cs.horzcat(*x)
    V = of.stitching.solve_symbolic(pulls)
    root = cs.MX(cs.DM(of.root_row.tocsc()))
    shift = root @ template.T + trans.T - root @ V  # (1, 3)
    return (V + cs.repmat(shift, N, 1)).T


def _as_symbol(array: Array) -> cs.MX:
    """An array as the symbol of a block of its shape has it: the axes reversed."""
    rows, columns = prod(array.shape[:-1]), array.shape[-1]
    return cs.MX(cs.sparsify(cs.DM(array.reshape(rows, columns).T)))


def _identities(count: int) -> cs.MX:
    """The 3 x 3 identity in each of so many rows."""
    return cs.MX(cs.DM(np.tile(np.eye(3).ravel(), (count, 1))))
