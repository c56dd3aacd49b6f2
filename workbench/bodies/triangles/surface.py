"""A triangle body in symbols: from pose, betas and trans to its stitched vertices."""

from __future__ import annotations

import casadi as cs
import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array
from workbench.bodies.forward.kinematics import world_rotations
from workbench.bodies.triangles.arithmetic import Arithmetic
from workbench.bodies.triangles.arrays import TriangleArrays


def posed(
    body: TriangleArrays, arithmetic: Arithmetic, pose: cs.MX, betas: cs.MX, trans: cs.MX
) -> cs.MX:
    """The vertices whose edges are nearest to X_f e_f, (3, N) m."""
    F = body.n_faces
    R = world_rotations(pose, body.parents)  # (3, 3) each
    # faces run down the rows; of a 3 x 3 matrix B[:, 3 c + r] is row r, column c
    B = cs.MX(cs.DM(body.weights.tocsc())) @ cs.vertcat(*[cs.vec(R_k).T for R_k in R])
    U = body.shapedirs.transpose(1, 2, 0, 3).reshape(9 * F, body.n_betas)
    D = cs.MX(np.repeat(np.eye(3).ravel(), F)) + cs.MX(cs.sparsify(cs.DM(U))) @ betas
    D = cs.reshape(D, F, 9)  # D[:, 3 r + c]
    bent = cs.MX(cs.DM(arithmetic.edges.transpose(1, 2, 0).ravel()))
    bent += cs.MX(cs.DM(_twists(body, arithmetic.bends))) @ cs.vec(pose)
    q = cs.reshape(bent, F, 6)  # Q_f e_fi: q[:, 3 i + a]
    pulls = cs.MX.zeros(body.n_vertices, 3)
    for i in range(2):
        y = [sum(D[:, 3 * r + c] * q[:, 3 * i + c] for c in range(3)) for r in range(3)]
        x = [sum(B[:, 3 * c + r] * y[c] for c in range(3)) for r in range(3)]
        A = cs.MX(cs.DM(csc_array(body.stitching.A[i::2].T.tocsc())))
        pulls += A @ cs.horzcat(*x)
    V = body.stitching.solve_symbolic(pulls)
    root = cs.MX(cs.DM(body.J_regressor[[0]].tocsc()))
    shift = cs.MX(cs.DM(arithmetic.root)).T + trans.T - root @ V  # (1, 3)
    return (V + cs.repmat(shift, body.n_vertices, 1)).T


def _twists(body: TriangleArrays, bends: Array) -> csc_array:
    """(6 F, 3 K): what vec(pose) adds to Q_f e_fi, in the rows (i, a, f)."""
    F, J = body.near.shape
    slopes = bends.reshape(F, 2, 3, J, 3)
    f, i, a, j, axis = np.indices(slopes.shape)
    rows = (3 * i + a) * F + f
    columns = 3 * body.near[f, j] + axis
    shape = (6 * F, 3 * body.n_joints)
    matrix = csc_array((slopes.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix
