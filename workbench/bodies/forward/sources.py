"""Three sources of points on a body: its surface, its joints, and landmarks on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as cs

from workbench.blocks import Block, NumericPoints, Tree
from workbench.bodies.forward import surface
from workbench.bodies.forward.arguments import Arguments
from workbench.bodies.forward.arrays import SkinnedArrays, Vertices
from workbench.bodies.forward.freed_points import FreedPoints
from workbench.bodies.forward.numeric_sources import Named
from workbench.bodies.forward.packed import PackedBody
from workbench.bodies.forward.skinning import linear_blend
from workbench.bodies.landmarks import Landmarks

MOVE_JOINTS = ("template", "shapedirs", "J_regressor")  # what joints are made from, if not given


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Vertices of the posed surface, all or some."""

    at: Arguments[SkinnedArrays]
    packed: PackedBody
    vertices: Vertices
    count: int = field(init=False)

    def __post_init__(self) -> None:
        every, chosen = range(self.at.body.n_vertices), self.vertices
        count = len(every[chosen] if isinstance(chosen, slice) else chosen)
        object.__setattr__(self, "count", count)

    @cached_property
    def expression(self) -> cs.MX:
        """The posed vertices in symbols, (3, N) m."""
        return surface.posed(self.at.body, *self.at.symbols, self.vertices)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and every free array."""
        return (*self.at.blocks(), *self.at.body.free.values())

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree of the body."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        if isinstance(self.vertices, slice):
            return None
        return tuple(f"vertex {i}" for i in self.vertices)

    @cached_property
    def numeric(self) -> NumericPoints | None:
        """None if an argument is not affine, or the body is not SMPL's.

        None, too, if arrays of the body are free and an argument is more than a block of its own.
        """
        maps, names, body = self.at.maps, self.at.names, self.at.body
        if maps is None or not body.is_smpl:
            return None
        if not body.free:
            return Named(self.packed.surface(self.vertices), maps)
        if names is None:
            return None
        free = {name: block.name for name, block in body.free.items()}
        if len({*names, *free.values()}) < 3 + len(free):
            return None
        return FreedPoints(self.packed.freed(self.vertices), names, free)


@dataclass(frozen=True, eq=False)
class JointPoints:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices."""

    at: Arguments[SkinnedArrays]
    packed: PackedBody

    @property
    def count(self) -> int:
        """K, the number of joints."""
        return self.at.body.n_joints

    @cached_property
    def expression(self) -> cs.MX:
        """The posed joints in symbols, (3, K) m."""
        posture = surface.posture(self.at.body, self.at.pose)
        _, joints = surface.motions(self.at.body, posture, self.at.betas)
        return joints + cs.repmat(self.at.trans, 1, self.count)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the free arrays that joints are made from.

        Joints that are given or free do not change with betas, which are among these all the same.
        """
        body = self.at.body
        regressed = body.rest_joints is None and "joints" not in body.free
        made_from = MOVE_JOINTS if regressed else ("joints",)
        return (*self.at.blocks(), *(b for name, b in body.free.items() if name in made_from))

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree of the body."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...]:
        """The joints' names."""
        return self.at.body.joint_names

    @cached_property
    def numeric(self) -> Named | None:
        """None if an argument is not affine, or arrays are free."""
        maps = self.at.maps
        return None if maps is None or self.at.body.free else Named(self.packed.joints, maps)


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Weighted means of posed vertices; only the vertices that carry weight are posed."""

    at: Arguments[SkinnedArrays]
    packed: PackedBody
    landmarks: Landmarks

    @property
    def count(self) -> int:
        """M, the number of landmarks."""
        return len(self.landmarks.names)

    @cached_property
    def expression(self) -> cs.MX:
        """(3, M) m: by one rest point for each joint that moves a landmark, where that is exact."""
        body = self.at.body
        if body.free or body.skinning is not linear_blend:
            regressor, used = self.landmarks.of_vertices
            posed = surface.posed(body, *self.at.symbols, used)
            return posed @ cs.MX(cs.DM(regressor.T.tocsc()))
        at = surface.posture(body, self.at.pose)
        G, _ = surface.motions(body, at, self.at.betas)
        means = self.packed.rest_points(self.landmarks).expression(
            G, body.features(at), self.at.betas
        )
        return means + cs.repmat(self.at.trans, 1, self.count)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and every free array."""
        return (*self.at.blocks(), *self.at.body.free.values())

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree of the body."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...]:
        """The landmarks' names."""
        return self.landmarks.names

    @cached_property
    def numeric(self) -> Named | None:
        """None if an argument is not affine, arrays are free, or the body is not SMPL's."""
        maps, body = self.at.maps, self.at.body
        if maps is None or body.free or not body.is_smpl:
            return None
        return Named(self.packed.landmarks(self.landmarks), maps)
