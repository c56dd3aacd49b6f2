"""A triangle body in symbols: from pose, betas and trans to its stitched vertices."""

from __future__ import annotations

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.triangles.packed import PackedTriangles


def posed(of: PackedTriangles, pose: cs.MX, betas: cs.MX, trans: cs.MX) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m."""
    F, N = len(of.edges), of.stitching.n_vertices
    R = world_rotations(pose, of.parents)  # (3, 3) each
    # faces run down the rows; of a 3 x 3 matrix B[:, 3 c + r] is row r, column c
    B = cs.MX(cs.DM(of.weights.tocsc())) @ cs.vertcat(*[cs.vec(R_k).T for R_k in R])
    D = cs.MX(np.repeat(np.eye(3).ravel(), F)) + cs.MX(cs.sparsify(cs.DM(of.shape_slopes))) @ betas
    D = cs.reshape(D, F, 9)  # D[:, 3 r + c]
    bends = of.bend_slopes.tocsc()
    bends.eliminate_zeros()
    bent = cs.MX(cs.DM(of.edges.transpose(1, 2, 0).ravel()))
    bent += cs.MX(cs.DM(bends)) @ cs.vec(pose)
    q = cs.reshape(bent, F, 6)  # Q_f e_fi: q[:, 3 i + a]
    pulls = cs.MX.zeros(N, 3)
    for i in range(2):
        y = [sum(D[:, 3 * r + c] * q[:, 3 * i + c] for c in range(3)) for r in range(3)]
        x = [sum(B[:, 3 * c + r] * y[c] for c in range(3)) for r in range(3)]
        A = cs.MX(cs.DM(csc_array(of.stitching.A[i::2].T.tocsc())))
        pulls += A @ cs.horzcat(*x)
    V = of.stitching.solve_symbolic(pulls)
    root = cs.MX(cs.DM(of.root_row.tocsc()))
    shift = cs.MX(cs.DM(of.root)).T + trans.T - root @ V  # (1, 3)
    return (V + cs.repmat(shift, N, 1)).T
