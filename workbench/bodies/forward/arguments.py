"""What stands for the pose, the betas and the translation of a body: affine maps of blocks.

Landmarks have a fourth argument, if they are displaced by offsets.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Points, Tree
from workbench.blocks.affine import Affine, alone, place_of
from workbench.bodies.body import Body
from workbench.bodies.forward.assembly import Maps
from workbench.errors import BadBody


@dataclass(frozen=True, eq=False)
class Arguments:
    """A body, and what stands for its pose (3, K) rad, betas (B, 1) and trans (3, 1) m.

    `displaced` is a block (L, 3) m for the offsets of L landmarks, and what stands for it; None
    if there are no offsets. Raises BadBody for what has another shape, or is no symbol or
    expression of symbols.
    """

    body: Body
    pose: cs.MX
    betas: cs.MX
    trans: cs.MX
    displaced: tuple[Block, cs.MX] | None = None

    def __post_init__(self) -> None:
        for block, given in self._given:
            if isinstance(given, cs.SX):
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol for {block.name}, not something of "
                    "type SX; take block.symbol for block in body.blocks(), which is an MX, for a "
                    "mesh is computed in matrices. SX takes its place afterwards: "
                    'casadi.Function("f", [pose, betas, trans], [points.graph()])(*your_sx)'
                )
            if not isinstance(given, cs.MX):
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol for {block.name}, not something of "
                    f"type {type(given).__name__}; take block.symbol for block in body.blocks(), "
                    "or give numbers to body.vertices"
                )
            if given.shape != block.symbol_shape:
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol of shape {block.symbol_shape} for "
                    f"{block.name}, not {given.shape}; take block.symbol for block in "
                    "body.blocks(), and body.offsets(name).symbol for the offsets of landmarks"
                )

    @property
    def symbols(self) -> tuple[cs.MX, cs.MX, cs.MX]:
        """In the order that a body takes them, without offsets."""
        return self.pose, self.betas, self.trans

    @property
    def offsets(self) -> cs.MX | None:
        """The offsets of landmarks, (3, L) m, if there are any."""
        return None if self.displaced is None else self.displaced[1]

    @property
    def _given(self) -> tuple[tuple[Block, cs.MX], ...]:
        """A block of the shape of each argument, and what stands for it."""
        own = tuple(zip(self.body.blocks(), self.symbols, strict=True))
        return own if self.displaced is None else (*own, self.displaced)

    def blocks(self) -> tuple[Block, ...]:
        """The block behind each symbol, the body's own (with unit and labels) where it is one.

        A symbol of another origin has the joints' names if it holds nothing but rotation vectors.
        """
        known = {b.symbol.__hash__(): b for b in self.body.known_blocks}
        if self.displaced is not None:
            block, given = self.displaced
            if given.is_symbolic() and given.__hash__() not in known:
                known[given.__hash__()] = Block.of(given, block.unit, block.labels)
        read = cs.symvar(cs.veccat(*(given for _, given in self._given)))
        return tuple(known.get(s.__hash__()) or self._piece(s) for s in read)

    def _piece(self, symbol: cs.MX) -> Block:
        """A block of rotation vectors, or one of which nothing is known."""
        block, tree = Block.of(symbol), self.tree
        at = {} if tree is None else {place: k for k, place in enumerate(tree.places)}
        joints = [at.get((block.name, 3 * row)) for row in range(block.size // 3)]
        names = [self.body.joint_names[k] for k in joints if k is not None]
        if not names or 3 * len(names) != block.size:
            return block
        if len(block.shape) == 1:
            names = [f"{name}, {axis}" for name in names for axis in "xyz"]
        return Block.of(symbol, "rad", tuple(names))

    @cached_property
    def tree(self) -> Tree | None:
        """The tree of the joints; None if the pose is no affine map of blocks."""
        if self.maps is None:
            return None
        pose, names, parents = self.maps[0], self.body.joint_names, self.body.parents
        if pose.plain is not None and self._apart:
            return Tree(pose.plain, names, parents)
        rows = alone(self.maps)[0]
        free_of_offset = pose.offset.reshape(-1, 3) == 0
        at = tuple(
            place_of(rows[3 * k : 3 * k + 3]) if free_of_offset[k].all() else None
            for k in range(len(names))
        )
        return Tree(" + ".join(pose.reads), names, parents, at)

    @cached_property
    def maps(self) -> Maps | None:
        """The arguments as affine maps of blocks; None if one of them is something else."""
        found = [Affine.of(given, block.shape) for block, given in self._given]
        maps = tuple(one for one in found if one is not None)
        return maps if len(maps) == len(found) else None

    @property
    def _apart(self) -> bool:
        """Whether no block has two roles."""
        reads = [name for one in self.maps or () for name in one.reads]
        return len(reads) == len(set(reads))


def arguments_from_values(
    body: Body, points: Iterable[Points], values: Mapping[str, ArrayLike]
) -> tuple[Array, Array, Array] | None:
    """The pose (K, 3) rad, betas (B,) and trans (3,) m of a body, from the values of named blocks.

    They are the values of the body's own blocks, where all of these have values. Otherwise they
    are computed from the blocks that `points` of this body are made from, which may be pieces of a
    pose or coefficients. None if the values do not determine them.
    """
    own = [block.name for block in body.blocks()]
    if all(name in values for name in own):
        pose, betas, trans = (np.asarray(values[name], dtype=float) for name in own)
        return pose, betas, trans
    for one in points:
        at = getattr(one.source, "arguments", None)
        if not isinstance(at, Arguments) or at.body is not body or at.maps is None:
            continue
        maps = at.maps[:3]
        if all(name in values for part in maps for name in part.reads):
            numbers = {name: np.asarray(value, dtype=float) for name, value in values.items()}
            pose, betas, trans = (part.value(numbers) for part in maps)
            return pose, betas, trans
    return None
