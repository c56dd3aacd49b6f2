"""A body in pieces: every joint's part has a place and a rotation of its own.

How should a body that moves be modelled? By 24 rigid parts of six numbers each, which are 144
numbers, or by a tree of rotations and one translation, which are 75? The parts can do all that the
tree can, but they fall apart; `gaps` says how far.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Block, Values
from workbench.bodies.ablations import without_blend_weights
from workbench.bodies.forward.skinning import linear_blend
from workbench.bodies.skinned import SkinnedBody
from workbench.geometry.rotation import matrix_from_vector, rodrigues, vector_from_matrix


@dataclass(frozen=True, eq=False)
class SeparateParts:
    """The mean person of `body`, cut into K rigid parts, one for each joint: 6 K numbers.

    Block `turns` (K, 3) rad holds each part's rotation in the world, `places` (K, 3) m where its
    joint is. A point of part k goes from v to R_k (v - j_k) + p_k.
    """

    body: SkinnedBody

    @cached_property
    def blocks(self) -> tuple[Block, Block]:
        """The blocks `turns` and `places`."""
        names = self.body.joint_names
        return (
            Block("turns", (len(names), 3), "rad", names),
            Block("places", (len(names), 3), "m", names),
        )

    def points(self) -> cs.MX:
        """The vertices (3, N) m in the symbols of the blocks."""
        turns, places = (block.symbol for block in self.blocks)
        body = self.rigid
        rest = body.joints()
        motions = [
            cs.horzcat(R, places[:, k] - R @ cs.DM(rest[k]))
            for k, R in enumerate(cs.horzsplit(rodrigues(turns), 3))
        ]
        weights = cs.MX(cs.sparsify(cs.DM(body.weights)))
        return linear_blend(cs.MX(cs.DM(body.template.T)), motions, weights)

    def vertices(self, turns: ArrayLike, places: ArrayLike) -> Array:
        """The surface (N, 3) m, for turns and places (K, 3)."""
        R, p = matrix_from_vector(turns), np.asarray(places, dtype=float)
        v, joints, part = self.body.template, self.body.joints(), self.part
        turned: Array = np.einsum("nij,nj->ni", R[part], v - joints[part])
        return np.asarray(turned + p[part])

    def gaps(self, turns: ArrayLike, places: ArrayLike) -> Array:
        """The distance of each joint from its place on the part of its parent, (K - 1,) m."""
        R, p, j = matrix_from_vector(turns), np.asarray(places, dtype=float), self.body.joints()
        up = list(self.body.parents[1:])
        there = np.einsum("kij,kj->ki", R[up], j[1:] - j[up]) + p[up]
        return np.asarray(np.linalg.norm(p[1:] - there, axis=1))

    def articulated(self, pose: ArrayLike, trans: ArrayLike = (0.0, 0.0, 0.0)) -> Values:
        """Values of the blocks for the parts of a tree, at pose (K, 3) rad and trans (3,) m."""
        pose = np.asarray(pose, dtype=float)
        motion = self.body.kinematics.motion(pose, np.zeros(self.body.n_betas))
        away = vector_from_matrix(motion.G[:, :, :3])
        places = self.body.joints(pose, trans=trans)
        return {block.name: a for block, a in zip(self.blocks, (away, places), strict=True)}

    @cached_property
    def part(self) -> Index:
        """The part to which each vertex belongs, (N,)."""
        return np.asarray(self.body.weights.argmax(axis=1))

    @cached_property
    def rigid(self) -> SkinnedBody:
        """The body with its weights one or zero."""
        return without_blend_weights(self.body)
