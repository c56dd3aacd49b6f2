"""One vertex of a linearly blended body in symbols: its point, and the point's derivative.

Compiled arithmetic is made from these functions; `numeric` has the formulas. Their inputs are
columns of numbers whose order is known here only:

    vertex     template (3,) and weights (K,) of one vertex
    shapedirs  (B, 3) of one vertex
    posedirs   (9, 3) of one vertex and one joint; most are zero, and left out
    motion     what the kinematics say at one pose and shape, the same for all vertices: betas,
               features, G (K, 3, 4), joints (K, 3), then per joint three axes and the slopes of
               its nine features by its three numbers (9 + 27; zeros for the root's slopes), then
               per beta and joint its shift of G (3,)
"""

from __future__ import annotations

from math import prod

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies.forward.arrays import SurfaceArrays
from workbench.bodies.forward.motion import Motion, Slopes

ADDED = frozenset(
    (
        *("bent", "bulging", "blended", "hung", "turned", "shifted"),
        *("on_features", "on_motion", "on_betas"),
    )
)
OF_JOINT = 9 + 27  # numbers of motion, of each joint: three axes, and slopes of nine features


def vertex_columns(arrays: SurfaceArrays, vertices: Index) -> Array:
    """The columns `vertex` of n vertices, (3 + K, n)."""
    return np.concatenate([arrays.template[vertices].T, arrays.weights[vertices].T])


def shape_columns(arrays: SurfaceArrays, vertices: Index) -> Array:
    """The columns `shapedirs` of n vertices, (3 B, n)."""
    by_beta = arrays.shapedirs[vertices].transpose(2, 1, 0)
    return by_beta.reshape(prod(by_beta.shape[:2]), len(vertices))


def motion_column(motion: Motion) -> Array:
    """The part of the column that all vertices share which is the motion itself."""
    if motion.column is not None:
        return motion.column
    parts = motion.features, motion.G, motion.joints
    return np.concatenate([part.ravel() for part in parts])


def slopes_column(slopes: Slopes) -> Array:
    """The part of the column that is the derivative of the motion."""
    if slopes.column is not None:
        return slopes.column
    K = len(slopes.turns)
    of_joints = np.zeros((K, OF_JOINT))
    turns = slopes.turns.reshape(K, 3, 3, 3)  # [axis]x
    of_joints[:, :9] = turns[:, :, (2, 0, 1), (1, 2, 0)].reshape(K, 9)
    of_joints[1:, 9:] = slopes.d_features.swapaxes(1, 2).reshape(K - 1, 27)
    shifts = slopes.d_shift.reshape(-1, 3, K).swapaxes(1, 2)
    return np.concatenate([of_joints.ravel(), shifts.ravel()])


def vertex_functions(B: int) -> dict[str, cs.Function]:
    """Functions of columns by name, for a body with B betas.

    They are small, for one joint or one beta each, so that what they need stays in registers, and
    that joints which leave a vertex alone cost nothing. The arguments called `motion` are the same
    for all vertices. M = sum_j w_j G_j, (3, 4), and other matrices of motions are stored row by
    row. Joint k carries y_k = w_k G_k [v; 1] and the share w_k; what hangs from it, (4,), is the
    sum of both over the joints at and below it. The caller sums the values of the functions that
    `ADDED` names.

        shaped       (template, shapedirs, betas) -> T + S betas, (3,) m
        bent         (posedirs_kn, features_kn) -> P_kn f_kn, (3,) m, of one feature
        blended      (w_k, G_k) -> w_k G_k, (12,)
        moved        (M, v) -> M [v; 1], (3,) m
        below        (w_k, G_k, v) -> y_k and w_k, (4,)
        hung         (hanging_k) -> itself, which is added to what hangs from the parent, (4,)
        arm          (hanging_k, joint_k) -> sum_{j at or below k} w_j (G'_j v - t_k), (3,) m
        bulging      (posedirs_kn, slopes_kn) -> what it adds to P_k df_k/d(pose_k), (3, 3) m/rad
        bulged       (M, P_k df_k/d(pose_k)) -> the same, turned by R, (3, 3) m/rad; with
        turned       (arm_k, motion_k) -> axes x arm_k it is d(point)/d(pose_k), (3, 3) m/rad
        by_beta      (shapedirs_b, M) -> R S_b, which is d(point)/d(beta_b), (3,) m,
        shifted      (w_k, motion_bk) -> but for the sum over k of w_k dG_k/d(beta_b), (3,) m
        on_rest      (M, cotangent) -> the gradient of cotangent . M [v; 1] by v, (3,)
        on_betas     (shapedirs, cotangent) -> that of cotangent . S betas, (B,)
        on_features  (posedirs_k, cotangent) -> that of cotangent . P_k f_k, (9,)
        on_motion    (w_k, v, cotangent) -> that of cotangent . w_k G_k [v; 1], (12,)
    """
    T, S, betas = cs.SX.sym("T", 3), cs.SX.sym("S", 3, B), cs.SX.sym("betas", B)
    P, f = cs.SX.sym("P", 3, 9), cs.SX.sym("f", 9)
    w, joint, hanging = cs.SX.sym("w"), cs.SX.sym("joint", 3), cs.SX.sym("hanging", 4)
    v, cotangent = cs.SX.sym("v", 3), cs.SX.sym("cotangent", 3)
    G, M = cs.SX.sym("G", 12), cs.SX.sym("M", 12)
    S_b, arm, shift = cs.SX.sym("S_b", 3), cs.SX.sym("arm", 3), cs.SX.sym("shift", 3)
    axes, slopes_n, bulging = cs.SX.sym("axes", 3, 3), cs.SX.sym("df", 3), cs.SX.sym("Pdf", 3, 3)

    R = matrix_of_rows(M, 3, 4)[:, :3]
    moved, carried = _moved(M, v), w * _moved(G, v)
    turned = cs.horzcat(*[cs.cross(axis, arm) for axis in cs.horzsplit(axes)])
    made = (
        function_of_columns("shaped", T + S @ betas, template=T, shapedirs=S, motion=betas),
        function_of_columns("bent", P[:, 0] * f[0], posedirs=P[:, 0], motion=f[0]),
        function_of_columns("blended", w * G, weight=w, motion=G),
        function_of_columns("moved", moved, M=M, v=v),
        function_of_columns("below", cs.vertcat(carried, w), weight=w, motion=G, v=v),
        function_of_columns("hung", hanging, hanging=hanging),
        function_of_columns("arm", hanging[:3] - hanging[3] * joint, hanging=hanging, motion=joint),
        function_of_columns("bulging", P[:, 0] @ slopes_n.T, posedirs=P[:, 0], motion=slopes_n),
        function_of_columns("bulged", R @ bulging, M=M, bulging=bulging),
        function_of_columns("turned", turned, arm=arm, motion=axes),
        function_of_columns("by_beta", R @ S_b, shapedirs=S_b, M=M),
        function_of_columns("shifted", w * shift, weight=w, motion=shift),
        function_of_columns("on_rest", _gradient(moved, cotangent, v), M=M, cotangent=cotangent),
        function_of_columns(
            "on_betas", _gradient(S @ betas, cotangent, betas), shapedirs=S, cotangent=cotangent
        ),
        function_of_columns(
            "on_features", _gradient(P @ f, cotangent, f), posedirs=P, cotangent=cotangent
        ),
        function_of_columns(
            "on_motion", _gradient(carried, cotangent, G), weight=w, v=v, cotangent=cotangent
        ),
    )
    return {function.name(): function for function in made}


def _moved(G: cs.SX, v: cs.SX) -> cs.SX:
    """The point G [v; 1], (3, 1), for a motion of 12 numbers row by row."""
    rows = matrix_of_rows(G, 3, 4)
    return rows[:, :3] @ v + rows[:, 3]


def _gradient(of: cs.SX, cotangent: cs.SX, by: cs.SX) -> cs.SX:
    return cs.gradient(cs.dot(cotangent, of), by)


def matrix_of_rows(column: cs.SX, rows: int, columns: int) -> cs.SX:
    """A matrix from its rows, one after the other."""
    return cs.reshape(column, columns, rows).T


def function_of_columns(name: str, output: cs.SX, **inputs: cs.SX) -> cs.Function:
    """A function from columns of numbers to one, with the names of its inputs."""
    columns = [cs.vec(column) for column in inputs.values()]
    return cs.Function(name, columns, [cs.densify(cs.vec(output))], [*inputs], ["out"])
