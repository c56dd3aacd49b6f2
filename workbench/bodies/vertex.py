"""One vertex of a linearly blended body in symbols: its point and derivative as they are computed.

The symbolic truth behind compiled arithmetic; `numeric` says the formulas. There are two kinds of
input, each a column of numbers whose order is known here only:

    vertex  template (3,), weights (K,), shapedirs (B, 3), posedirs (9 (K - 1), 3) of one vertex
    motion  what the kinematics say at one pose and shape, the same for all vertices: betas,
            features, G (K, 3, 4), joints (K, 3), then per joint three axes and its features'
            derivative (9 + 27; zeros for the root's), then per beta its shift of G (3 K)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from math import prod

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.bodies.motion import Motion, Slopes
from workbench.bodies.numeric import SurfaceArrays

Array = NDArray[np.float64]
OF_JOINT = 36  # numbers of motion: three axes, and the slopes of nine features


@dataclass(frozen=True, eq=False)
class VertexFunctions:
    """Functions of columns, `motion...` being the same for all vertices; K joints, B betas."""

    point: cs.Function  # (vertex, motion) -> (3, 1) m, before translation
    rotation: cs.Function  # (vertex, motion) -> R = sum_j w_j R_j, (3, 3)
    arms: cs.Function  # (vertex, motion) -> sum_{j at or below k} w_j (G'_j v - t_k), (3, K) m
    by_joint: cs.Function  # (posedirs_k, R, arm, motion_k) -> d(point)/d(pose_k), (3, 3) m/rad
    by_beta: cs.Function  # (shapedirs_b, R, weights, motion_b) -> d(point)/d(beta_b), (3, 1) m
    pulled: cs.Function  # (vertex, motion, pull) -> pull . d(point)/d(betas, features, G)

    @property
    def all(self) -> tuple[cs.Function, ...]:
        """In the order above."""
        return tuple(getattr(self, field.name) for field in fields(self))


def vertex_columns(arrays: SurfaceArrays, vertices: NDArray[np.int64]) -> Array:
    """A column for each of n vertices, (., n)."""
    parts = (
        arrays.template[vertices],
        arrays.weights[vertices],
        arrays.shapedirs[vertices].transpose(0, 2, 1),
        arrays.posedirs[vertices].transpose(0, 2, 1),
    )
    return np.concatenate([part.reshape(len(vertices), prod(part.shape[1:])).T for part in parts])


def motion_column(motion: Motion, betas: Array, slopes: Slopes | None = None) -> Array:
    """The column that all vertices share."""
    K = len(motion.G)
    parts = [betas, motion.features, motion.G, motion.joints]
    if slopes is not None:
        of_joints = np.zeros((K, OF_JOINT))
        turns = slopes.turns.reshape(K, 3, 3, 3)  # [axis]x
        of_joints[:, :9] = turns[:, :, (2, 0, 1), (1, 2, 0)].reshape(K, 9)
        of_joints[1:, 9:] = slopes.d_features.reshape(K - 1, 27)
        parts += [of_joints, slopes.d_shift]
    return np.concatenate([part.ravel() for part in parts])


def vertex_functions(parents: tuple[int, ...], B: int) -> VertexFunctions:
    """Those of a body with B betas on this tree of K joints."""
    K = len(parents)
    of_vertex = (3, K, 3 * B, 27 * (K - 1))
    of_motion = (B, 9 * (K - 1), 12 * K, 3 * K, OF_JOINT * K, 3 * K * B)
    vertex, motion = cs.SX.sym("vertex", sum(of_vertex)), cs.SX.sym("motion", sum(of_motion))
    template, weights, shapedirs, posedirs = _split(vertex, of_vertex)
    betas, features, G, joints = _split(motion, of_motion)[:4]
    w, motions = cs.vertsplit(weights), [_rows(part, 3, 4) for part in _split(G, [12] * K)]

    blended = sum(w_j * G_j for w_j, G_j in zip(w, motions, strict=True))
    bends = [  # joint by joint: short sums that do not wait for each other
        cs.reshape(P_k, 3, 9) @ f_k
        for P_k, f_k in zip(
            _split(posedirs, [27] * (K - 1)), _split(features, [9] * (K - 1)), strict=True
        )
    ]
    rest = sum(bends, template + cs.reshape(shapedirs, 3, B) @ betas)
    point = blended[:, :3] @ rest + blended[:, 3]

    below = [w_j * (G_j[:, :3] @ rest + G_j[:, 3]) for w_j, G_j in zip(w, motions, strict=True)]
    share = [*w]
    for k in range(K - 1, 0, -1):  # children come after their parents
        below[parents[k]] += below[k]
        share[parents[k]] += share[k]
    centres = _split(joints, [3] * K)
    arms = [b - s * t for b, s, t in zip(below, share, centres, strict=True)]

    pull = cs.SX.sym("pull", 3)
    felt = cs.gradient(cs.dot(point, pull), motion)[: B + 9 * (K - 1) + 12 * K]
    return VertexFunctions(
        _function("point", point, vertex=vertex, motion=motion),
        _function("rotation", blended[:, :3], vertex=vertex, motion=motion),
        _function("arms", cs.horzcat(*arms), vertex=vertex, motion=motion),
        _by_joint(),
        _by_beta(K),
        _function("pulled", felt, vertex=vertex, motion=motion, pull=pull),
    )


def _by_joint() -> cs.Function:
    """axis_a x arm + R P_k df_k/da for the three numbers a of joint k."""
    P, R, arm = cs.SX.sym("P", 3, 9), cs.SX.sym("R", 3, 3), cs.SX.sym("arm", 3)
    motion = cs.SX.sym("motion", OF_JOINT)
    axes, slopes = cs.reshape(motion[:9], 3, 3), cs.reshape(motion[9:], 9, 3)
    turned = cs.horzcat(*[cs.cross(axis, arm) for axis in cs.horzsplit(axes)])
    return _function("by_joint", turned + R @ (P @ slopes), posedirs=P, R=R, arm=arm, motion=motion)


def _by_beta(K: int) -> cs.Function:
    """R S_b + sum_j w_j dG_j/dbeta_b, of which only the last column moves."""
    S, R, w = cs.SX.sym("S", 3), cs.SX.sym("R", 3, 3), cs.SX.sym("w", K)
    motion = cs.SX.sym("motion", 3 * K)
    shift = _rows(motion, 3, K) @ w
    return _function("by_beta", R @ S + shift, shapedirs=S, R=R, weights=w, motion=motion)


def _split(column: cs.SX, sizes: Sequence[int]) -> list[cs.SX]:
    edges = np.cumsum([0, *sizes]).tolist()
    return [column[first:last] for first, last in pairwise(edges)]


def _rows(column: cs.SX, rows: int, columns: int) -> cs.SX:
    """A matrix from its rows, one after the other."""
    return cs.reshape(column, columns, rows).T


def _function(name: str, output: cs.SX, **inputs: cs.SX) -> cs.Function:
    columns = [cs.vec(column) for column in inputs.values()]
    return cs.Function(name, columns, [cs.densify(cs.vec(output))], [*inputs], ["out"])
