"""Skinning: how the motions of several joints move each vertex; SMPL's skinning function W."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.kinematics import binding_motions
from workbench.errors import BadArgument
from workbench.geometry.dual_quaternions import dual_quaternions, moved
from workbench.geometry.rotation import Matrix, rodrigues

Skinning = Callable[[cs.MX, Sequence[cs.MX], cs.MX], cs.MX]


def linear_blend(points: Matrix, motions: Sequence[Matrix], weights: Matrix) -> Matrix:
    """v'_i = sum over k of w_ik G'_k v_i, for points (3, N) in m, motions (3, 4), weights (N, K).

    Linear blend skinning (SMPL eq. 2).
    """
    return blend_points(points, 1.0, motions, weights)


def blend_points(
    points: Matrix, mass: Matrix | float, motions: Sequence[Matrix], weights: Matrix
) -> Matrix:
    """sum over k of w_ik G'_k (p_i; m_i), for points (3, N) of mass m (N, 1), or one for all."""
    stacked = cs.vertcat(*[cs.vec(G).T for G in motions])  # (K, 12)
    M = weights @ stacked  # (N, 12): a (3, 4) per vertex, column by column
    columns = cs.horzsplit(M, 3)  # what multiplies x, y, z and the mass, each (N, 3)
    x, y, z = (points[axis, :].T for axis in range(3))
    rows = [
        columns[0][:, d] * x + columns[1][:, d] * y + columns[2][:, d] * z + columns[3][:, d] * mass
        for d in range(3)
    ]
    return cs.horzcat(*rows).T


def blend_matrices(weights: Array, matrices: Array) -> Array:
    """sum over k of w_ik M_k in numbers, (..., N, 3, 3), of weights (N, K) and M (..., K, 3, 3)."""
    *batch, K, rows, columns = matrices.shape
    flat = weights @ matrices.reshape(*batch, K, rows * columns)
    return np.asarray(flat).reshape(*batch, len(weights), rows, columns)


def dual_quaternion_blend(points: cs.MX, motions: Sequence[cs.MX], weights: cs.MX) -> cs.MX:
    """v'_i is v_i, moved by the dual quaternion sum over k of w_ik s_ik q_k, normalised.

    q_k are the motions G'_k as dual quaternions, and s_ik is 1 or -1, the sign that brings q_k to
    the side of the joint that weighs most in vertex i.

    Dual quaternion blending (Kavan et al. 2008): every vertex is moved rigidly, so that twisted
    limbs keep their radius. If the rotations of two joints that a vertex blends are 180 degrees
    apart, the ways in both directions are equally long. There the vertex jumps from one to the
    other, and has no derivative.

    For points (3, N) in m, motions (3, 4), weights (N, K).
    """
    Q = dual_quaternions(motions)
    return moved(points, blended(Q, weights))


def unskinned(points: cs.MX, motions: Sequence[cs.MX], weights: cs.MX) -> cs.MX:
    """The points (3, N) m unchanged: no joint moves them."""
    return points


def blended(Q: cs.MX, weights: cs.MX) -> cs.MX:
    """sum over k of w_ik s_ik q_k, (8, N), for dual quaternions (8, K) and weights (N, K).

    q and -q are the same motion. The sign s_ik brings q_k to the side of the joint that weighs
    most in vertex i, so that no vertex takes the long way round, and none can meet a sum of zero.
    """
    q = Q[:4, :]
    side = 1 - 2 * (q.T @ q < 0)  # (K, K)
    return ((weights * (heaviest(weights) @ side)) @ Q.T).T


def heaviest(weights: cs.MX) -> cs.MX:
    """A matrix (N, K) with 1 at the first of the largest weights of every vertex, 0 elsewhere."""
    first, *others = cs.horzsplit(cs.densify(weights), 1)
    largest, where = first, 0 * first
    for k, column in enumerate(others, start=1):
        where = cs.if_else(column > largest, k, where)
        largest = cs.fmax(largest, column)
    indicators = cs.horzcat(*[where == k for k in range(weights.shape[1])])
    return indicators if cs.symvar(indicators) else cs.MX(cs.sparsify(cs.evalf(indicators)))


def skin(T: Any, J: Any, weights: Any, theta: Any, parents: Sequence[int]) -> Any:
    """The posed points (3, N) m in symbols: W(T, J, weights, theta).

        w_i = sum over k of weights[i, k] G'_k(theta, J) (t_i; 1)                  (SMPL eq. 2)
        G'_k(theta, J) = G_k(theta, J) G_k(0, J)^-1                                (SMPL eq. 3)
        G_k(theta, J) = product over the joints j from the root to k of
                        [exp(theta_j), J_j - J_parent(j); 0, 1]                    (SMPL eq. 4)

    T (3, N) m are the points at rest, J (3, K) m the joints at rest, weights (N, K) and theta
    (3, K) rad rotation vectors. Each is a symbol or an expression of CasADi, MX or SX, or an array
    of numbers of that shape; the result is of the same kind. It is linear in T, in J and in the
    weights, each alone. A body's own surface is W(T + B_S(beta) + B_P(theta), J(beta), weights,
    theta), which `SkinnedBody.points` writes for its own arrays.

    Raises BadArgument for MX together with SX, and for shapes that do not fit.
    """
    arguments = {"T": T, "J": J, "weights": weights, "theta": theta}
    kinds = {type(a) for a in arguments.values() if isinstance(a, (cs.MX, cs.SX))}
    if len(kinds) > 1:
        raise BadArgument("the skinning function takes symbols of one kind, not MX and SX")
    kind = kinds.pop() if kinds else cs.DM
    matrices = {name: a if isinstance(a, kind) else kind(cs.DM(a)) for name, a in arguments.items()}
    N, K = matrices["T"].shape[1], len(parents)
    for name, shape in {"T": (3, N), "J": (3, K), "weights": (N, K), "theta": (3, K)}.items():
        if matrices[name].shape != shape:
            raise BadArgument(f"{name} has shape {matrices[name].shape}, but must be {shape}")
    at_zero, R = (rodrigues(pose) for pose in (kind(cs.DM.zeros(3, K)), matrices["theta"]))
    motions, _ = binding_motions(R, at_zero, matrices["J"], parents)
    return linear_blend(matrices["T"], motions, matrices["weights"])
