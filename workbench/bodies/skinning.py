"""Blending the motions of several joints into one per vertex."""

from collections.abc import Callable, Sequence

import casadi as cs

Skinning = Callable[[cs.MX, Sequence[cs.MX], cs.MX], cs.MX]


def linear_blend(points: cs.MX, motions: Sequence[cs.MX], weights: cs.MX) -> cs.MX:
    """v'_i = sum over k of w_ik G'_k v_i, for points (3, N) in m, motions (3, 4), weights (N, K).

    Linear blend skinning (SMPL eq. 2).
    """
    stacked = cs.vertcat(*[cs.vec(G).T for G in motions])  # (K, 12)
    M = weights @ stacked  # (N, 12): a (3, 4) per vertex, column by column
    columns = cs.horzsplit(M, 3)  # what multiplies x, y, z and 1, each (N, 3)
    x, y, z = (points[axis, :].T for axis in range(3))
    rows = [
        columns[0][:, d] * x + columns[1][:, d] * y + columns[2][:, d] * z + columns[3][:, d]
        for d in range(3)
    ]
    return cs.horzcat(*rows).T
