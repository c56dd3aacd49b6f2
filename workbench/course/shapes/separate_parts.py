"""A body in pieces: every joint's part has a place and a rotation of its own.

The lectures' question of how to model a body that moves: 24 rigid parts of six numbers each, 144,
or a tree of rotations and one translation, 75. The parts can do all that the tree can, and fall
apart; `gaps` says how far.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.blocks import Block, NumericPoints, Points, Tree, Values
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
    _made: dict[str, tuple[Block, Block]] = field(default_factory=dict, init=False, repr=False)

    def blocks(self, prefix: str = "") -> tuple[Block, Block]:
        """`turns` and `places`: the same objects for the same prefix."""
        if prefix not in self._made:
            names = self.body.joint_names
            self._made[prefix] = (
                Block(prefix + "turns", (len(names), 3), "rad", names),
                Block(prefix + "places", (len(names), 3), "m", names),
            )
        return self._made[prefix]

    def points(self, turns: cs.MX, places: cs.MX) -> Points:
        """The surface, (3, N) m."""
        return Points.of(PartPoints(self, turns, places), "parts")

    def vertices(self, turns: ArrayLike, places: ArrayLike) -> Array:
        """The surface (N, 3) m, for turns and places (K, 3)."""
        R, p = matrix_from_vector(turns), np.asarray(places, dtype=float)
        v, joints, part = self.body.template, self.body.joints(), self.part
        turned: Array = np.einsum("nij,nj->ni", R[part], v - joints[part])
        return np.asarray(turned + p[part])

    def gaps(self, turns: ArrayLike, places: ArrayLike) -> Array:
        """How far each joint is from where its parent's part has it, (K - 1,) m."""
        R, p, j = matrix_from_vector(turns), np.asarray(places, dtype=float), self.body.joints()
        up = list(self.body.parents[1:])
        there = np.einsum("kij,kj->ki", R[up], j[1:] - j[up]) + p[up]
        return np.asarray(np.linalg.norm(p[1:] - there, axis=1))

    def articulated(self, pose: ArrayLike, trans: ArrayLike = (0.0, 0.0, 0.0)) -> Values:
        """The parts as the tree has them, for pose (K, 3) rad and trans (3,) m: without gaps."""
        pose = np.asarray(pose, dtype=float)
        motion = self.body.kinematics.motion(pose, np.zeros(self.body.n_betas))
        away = vector_from_matrix(motion.G[:, :, :3])
        places = self.body.joints(pose, trans=trans)
        return {block.name: a for block, a in zip(self.blocks(), (away, places), strict=True)}

    @cached_property
    def part(self) -> Index:
        """The part to which each vertex belongs, (N,)."""
        return np.asarray(self.body.weights.argmax(axis=1))

    @cached_property
    def rigid(self) -> SkinnedBody:
        """The body with its weights one or zero."""
        return without_blend_weights(self.body)


@dataclass(frozen=True, eq=False)
class PartPoints:
    """Vertices of separate parts, as a problem asks for them."""

    parts: SeparateParts
    turns: cs.MX
    places: cs.MX

    @property
    def count(self) -> int:
        """The number of vertices N."""
        return self.parts.body.n_vertices

    @cached_property
    def expression(self) -> cs.MX:
        """The points (3, N) m."""
        body = self.parts.rigid
        rest = body.joints()
        motions = [
            cs.horzcat(R, self.places[:, k] - R @ cs.DM(rest[k]))
            for k, R in enumerate(cs.horzsplit(rodrigues(self.turns), 3))
        ]
        weights = cs.MX(cs.sparsify(cs.DM(body.weights)))
        return linear_blend(cs.MX(cs.DM(body.template.T)), motions, weights)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of the arguments."""
        known = {b.symbol.__hash__(): b for made in self.parts._made.values() for b in made}
        read = cs.symvar(cs.veccat(self.turns, self.places))
        return tuple(known.get(s.__hash__()) or Block.of(s) for s in read)

    @property
    def tree(self) -> Tree | None:
        """None: the parts hang on no tree, which is the point."""
        return None

    @property
    def labels(self) -> tuple[str, ...] | None:
        """None: vertices have no names."""
        return None

    @property
    def numeric(self) -> NumericPoints | None:
        """None: the points come from the graph."""
        return None
