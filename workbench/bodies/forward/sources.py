"""Where points of a body come from: its surface, its joints, or landmarks on it.

What stands for pose, betas and translation are affine maps of blocks (`Arguments`). Landmarks have
a fourth argument, if they are displaced by offsets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, NumericPoints, Points, Tree
from workbench.blocks.affine import Affine, alone, place_of
from workbench.blocks.points import Rest
from workbench.bodies.body import Body, Landmarks
from workbench.bodies.forward import surface
from workbench.bodies.forward.named_points import BlockPoints, Maps, plain_names
from workbench.bodies.forward.posed_points import BodyNumbers
from workbench.bodies.forward.surface import Vertices
from workbench.errors import BadBody

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

MOVE_JOINTS = ("template", "shapedirs", "J_regressor")  # what joints are made from, if not given


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
        for block, value in self._pairs:
            if not isinstance(value, cs.MX):
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol for {block.name}, not something of "
                    f"type {type(value).__name__}; take block.symbol for block in body.blocks(), "
                    "or give numbers to body.vertices. SX takes its place afterwards, in "
                    'casadi.Function("f", [pose, betas, trans], [points.graph()])(*your_sx)'
                )
            if value.shape != block.symbol_shape:
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol of shape {block.symbol_shape} for "
                    f"{block.name}, not {value.shape}; take block.symbol for block in "
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
    def _pairs(self) -> tuple[tuple[Block, cs.MX], ...]:
        """A block of the shape of each argument, and what stands for it."""
        pairs = tuple(zip(self.body.blocks(), self.symbols, strict=True))
        return pairs if self.displaced is None else (*pairs, self.displaced)

    def blocks(self) -> tuple[Block, ...]:
        """The block behind each symbol, the body's own (with unit and labels) where it is one."""
        block_of = {b.symbol.__hash__(): b for b in self.body.known_blocks}
        if self.displaced is not None:
            block, value = self.displaced
            if value.is_symbolic() and value.__hash__() not in block_of:
                block_of[value.__hash__()] = Block.of(value, block.unit, block.labels)
        symbols = cs.symvar(cs.veccat(*(value for _, value in self._pairs)))
        return tuple(block_of.get(s.__hash__()) or Block.of(s) for s in symbols)

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
        places = tuple(
            place_of(rows[3 * k : 3 * k + 3]) if free_of_offset[k].all() else None
            for k in range(len(names))
        )
        return Tree(" + ".join(pose.reads), names, parents, places)

    @cached_property
    def maps(self) -> Maps | None:
        """The arguments as affine maps of blocks; None if one of them is something else."""
        affine = [Affine.of(value, block.shape) for block, value in self._pairs]
        maps = tuple(part for part in affine if part is not None)
        return maps if len(maps) == len(affine) else None

    @property
    def _apart(self) -> bool:
        """Whether no block has two roles."""
        reads = [name for part in self.maps or () for name in part.reads]
        return len(reads) == len(set(reads))


@dataclass(frozen=True, eq=False)
class BodySource:
    """A source of points on a body; see PointSource.

    Attributes:
        arguments: the body, and the arguments for its pose, betas and trans.
        count: the number of points.
        labels: a name for each point, where they have names.
        free: the free arrays of the body that the points depend on.
        express: makes the points in symbols, (3, N) m.
        compute: makes the points by arithmetic of affine arguments, or None where there is none.
        rigid_bones: whether the body's joints keep their places on rigid bones, as the tree says.
        resting: says which blocks the body at rest is made of.
    """

    arguments: Arguments
    count: int
    labels: tuple[str, ...] | None
    free: tuple[Block, ...]
    express: Callable[[], cs.MX]
    compute: Callable[[Maps], NumericPoints | None]
    rigid_bones: bool = True
    resting: Callable[[Maps], Rest | None] = lambda maps: None

    @cached_property
    def expression(self) -> cs.MX:
        """The points in symbols, (3, N) m."""
        return self.express()

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks of the arguments, and the free arrays."""
        return (*self.arguments.blocks(), *self.free)

    @cached_property
    def tree(self) -> Tree | None:
        """The kinematic tree of the body; None if the pose is no affine map of blocks."""
        tree = self.arguments.tree
        return None if tree is None else replace(tree, rigid_bones=self.rigid_bones)

    @cached_property
    def rest(self) -> Rest | None:
        """The body at rest, if it is made of blocks alone; otherwise None."""
        return None if self.arguments.maps is None else self.resting(self.arguments.maps)

    @cached_property
    def numeric(self) -> NumericPoints | None:
        """The points by arithmetic; None if an argument is not affine, or there is none."""
        return None if self.arguments.maps is None else self.compute(self.arguments.maps)


def surface_points(
    body: SkinnedBody, arguments: Arguments, numeric: BodyNumbers, vertices: Vertices
) -> BodySource:
    """Vertices of the posed surface, all or some.

    Arithmetic is that of SMPL. If arrays of the body are free as well, each argument must be a
    block of its own.
    """

    def compute(maps: Maps) -> NumericPoints | None:
        if not body.is_smpl:
            return None
        if not body.free:
            return BlockPoints(numeric.surface(vertices), maps)
        names, free = plain_names(maps), {name: block.name for name, block in body.free.items()}
        if names is None or len({*names, *free.values()}) < 3 + len(free):
            return None
        return numeric.freed(vertices, names, free)

    def resting(maps: Maps) -> Rest | None:
        pose, trans = maps[0].plain, maps[2].plain
        if pose is None or trans is None or not body.is_smpl or body.bind_pose.any():
            return None
        arrays = (body.free.get(name) for name in ("template", "joints", "posedirs"))
        return Rest(pose, trans, *(None if block is None else block.name for block in arrays))

    every = range(body.n_vertices)
    return BodySource(
        arguments,
        len(every[vertices] if isinstance(vertices, slice) else vertices),
        None if isinstance(vertices, slice) else tuple(f"vertex {i}" for i in vertices),
        tuple(body.free.values()),
        lambda: surface.posed(body, *arguments.symbols, vertices),
        compute,
        resting=resting,
    )


def joint_points(body: SkinnedBody, arguments: Arguments, numeric: BodyNumbers) -> BodySource:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices.

    They depend on the free arrays that joints are made from. Joints that are given or free do not
    change with betas, which are among the blocks all the same.
    """

    def express() -> cs.MX:
        posture = surface.posture(body, arguments.pose, arguments.betas)
        _, joints = surface.motions(body, posture)
        return joints + cs.repmat(arguments.trans, 1, body.n_joints)

    regressed = body.rest_joints is None and "joints" not in body.free
    made_from = MOVE_JOINTS if regressed else ("joints",)
    return BodySource(
        arguments,
        body.n_joints,
        body.joint_names,
        tuple(block for name, block in body.free.items() if name in made_from),
        express,
        lambda maps: None if body.free else BlockPoints(numeric.joints, maps),
    )


def landmark_points(
    body: SkinnedBody, arguments: Arguments, numeric: BodyNumbers, landmarks: Landmarks
) -> BodySource:
    """Weighted means of posed vertices, displaced at rest where the arguments have offsets.

    Only the vertices that carry weight are posed. Where that is exact, there is one rest point
    instead for each joint that moves a landmark.
    """

    def express() -> cs.MX:
        rest_points = partial(numeric.rest_points, landmarks)
        symbols, offsets = arguments.symbols, arguments.offsets
        return surface.posed_landmarks(body, landmarks, rest_points, symbols, offsets)

    def compute(maps: Maps) -> NumericPoints | None:
        if body.free or not body.is_smpl:
            return None
        return BlockPoints(numeric.landmarks(landmarks), maps)

    names, free = landmarks.names, tuple(body.free.values())
    return BodySource(arguments, len(names), names, free, express, compute)


def arguments_from_values(
    body: Body, points: Iterable[Points], values: Mapping[str, ArrayLike]
) -> tuple[Array, Array, Array] | None:
    """The pose (K, 3) rad, betas (B,) and trans (3,) m of a body, from the values of named blocks.

    They are the values of the body's own blocks, where all of these have values. Otherwise they
    are computed from the blocks that `points` of this body are made from, which may be pieces of a
    pose or coefficients. None if the values do not determine them.
    """
    names = [block.name for block in body.blocks()]
    if all(name in values for name in names):
        pose, betas, trans = (np.asarray(values[name], dtype=float) for name in names)
        return pose, betas, trans
    for part in points:
        arguments = part.source.arguments if isinstance(part.source, BodySource) else None
        if arguments is None or arguments.body is not body or arguments.maps is None:
            continue
        maps = arguments.maps[:3]
        if all(name in values for affine in maps for name in affine.reads):
            numbers = {name: np.asarray(value, dtype=float) for name, value in values.items()}
            pose, betas, trans = (affine.value(numbers) for affine in maps)
            return pose, betas, trans
    return None
