"""Where points of a body come from: its surface, its joints, or landmarks on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import casadi as cs

from workbench.arrays import Array
from workbench.blocks import Block, NumericPoints, Tree
from workbench.blocks.tree import Rest
from workbench.bodies.body import Landmarks
from workbench.bodies.forward import surface
from workbench.bodies.forward.arguments import Arguments
from workbench.bodies.forward.arrays import SkinnedArrays, Vertices
from workbench.bodies.forward.assembly import Maps, plain_names
from workbench.bodies.forward.landmark_symbols import posed_landmarks
from workbench.bodies.forward.numeric_body import NumericBody
from workbench.bodies.forward.numeric_sources import Named

MOVE_JOINTS = ("template", "shapedirs", "J_regressor")  # what joints are made from, if not given


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
        posedirs: the pose blend shapes of a skinned body, if they move the points.
        rigid_bones: whether the body's joints keep their places on rigid bones, as the tree says.
        resting: says which blocks the body at rest is made of.
    """

    arguments: Arguments
    count: int
    labels: tuple[str, ...] | None
    free: tuple[Block, ...]
    express: Callable[[], cs.MX]
    compute: Callable[[Maps], NumericPoints | None]
    posedirs: Array | None = None
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

    @property
    def bent(self) -> bool:
        """Whether pose blend shapes move the points."""
        return self.posedirs is not None and bool(self.posedirs.any())

    @cached_property
    def numeric(self) -> NumericPoints | None:
        """The points by arithmetic; None if an argument is not affine, or there is none."""
        return None if self.arguments.maps is None else self.compute(self.arguments.maps)


def surface_points(
    body: SkinnedArrays, at: Arguments, numeric: NumericBody, vertices: Vertices
) -> BodySource:
    """Vertices of the posed surface, all or some.

    Arithmetic is that of SMPL. If arrays of the body are free as well, each argument must be a
    block of its own.
    """

    def compute(maps: Maps) -> NumericPoints | None:
        if not body.is_smpl:
            return None
        if not body.free:
            return Named(numeric.surface(vertices), maps)
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
        at,
        len(every[vertices] if isinstance(vertices, slice) else vertices),
        None if isinstance(vertices, slice) else tuple(f"vertex {i}" for i in vertices),
        tuple(body.free.values()),
        lambda: surface.posed(body, *at.symbols, vertices),
        compute,
        body.posedirs,
        resting=resting,
    )


def joint_points(body: SkinnedArrays, at: Arguments, numeric: NumericBody) -> BodySource:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices.

    They depend on the free arrays that joints are made from. Joints that are given or free do not
    change with betas, which are among the blocks all the same.
    """

    def express() -> cs.MX:
        posture = surface.posture(body, at.pose, at.betas)
        _, joints = surface.motions(body, posture)
        return joints + cs.repmat(at.trans, 1, body.n_joints)

    regressed = body.rest_joints is None and "joints" not in body.free
    made_from = MOVE_JOINTS if regressed else ("joints",)
    return BodySource(
        at,
        body.n_joints,
        body.joint_names,
        tuple(block for name, block in body.free.items() if name in made_from),
        express,
        lambda maps: None if body.free else Named(numeric.joints, maps),
    )


def landmark_points(
    body: SkinnedArrays, at: Arguments, numeric: NumericBody, landmarks: Landmarks
) -> BodySource:
    """Weighted means of posed vertices, displaced at rest where the arguments have offsets.

    Only the vertices that carry weight are posed. Where that is exact, there is one rest point
    instead for each joint that moves a landmark.
    """

    def express() -> cs.MX:
        rest_points = partial(numeric.rest_points, landmarks)
        return posed_landmarks(body, landmarks, rest_points, at.symbols, at.offsets)

    def compute(maps: Maps) -> NumericPoints | None:
        if body.free or not body.is_smpl:
            return None
        return Named(numeric.landmarks(landmarks), maps)

    names, free = landmarks.names, tuple(body.free.values())
    return BodySource(at, len(names), names, free, express, compute, body.posedirs)
