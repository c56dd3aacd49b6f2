"""Three sources of points on a body: its surface, its joints, and landmarks on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np

from workbench.blocks import Block, NumericPoints, Tree
from workbench.bodies import surface
from workbench.bodies.arithmetic import arithmetic_of
from workbench.bodies.numeric_sources import NumericLandmarks, NumericSurface
from workbench.bodies.skinning import linear_blend

if TYPE_CHECKING:
    from workbench.bodies.skinned import Landmarks, SkinnedBody

Arguments = tuple[cs.MX, cs.MX, cs.MX]  # pose (3, K), betas (B, 1), trans (3, 1)


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Vertices of the posed surface, all or some."""

    body: SkinnedBody
    arguments: Arguments
    vertices: surface.Vertices

    @cached_property
    def expression(self) -> cs.MX:
        """(3, N) m."""
        return surface.posed(self.body, *self.arguments, self.vertices)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self)

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        if isinstance(self.vertices, slice):
            return None
        return tuple(f"vertex {i}" for i in self.vertices)

    @cached_property
    def numeric(self) -> NumericSurface | None:
        """None if arrays are free, the skinning is not linear, or an argument is no plain block."""
        if self.body.free or self.body.skinning is not linear_blend:
            return None
        if not all(argument.is_symbolic() for argument in self.arguments):
            return None
        if len({argument.name() for argument in self.arguments}) < 3:
            return None  # one block in two roles: its derivatives would have to be added
        arithmetic = arithmetic_of(self.body, self.vertices)
        return NumericSurface(self.body, arithmetic, *(a.name() for a in self.arguments))


@dataclass(frozen=True, eq=False)
class JointPoints:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices."""

    body: SkinnedBody
    arguments: Arguments

    @cached_property
    def expression(self) -> cs.MX:
        """(3, K) m."""
        pose, betas, trans = self.arguments
        joints = surface.motions(self.body, pose, betas)[2]
        return joints + cs.repmat(trans, 1, self.body.n_joints)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self)

    @property
    def labels(self) -> tuple[str, ...]:
        """The joints' names."""
        return self.body.joint_names

    @property
    def numeric(self) -> NumericPoints | None:
        """None: there are so few joints that the graph is as fast."""
        return None


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Weighted means of posed vertices; only the vertices that carry weight are posed."""

    body: SkinnedBody
    landmarks: Landmarks
    arguments: Arguments

    @cached_property
    def expression(self) -> cs.MX:
        """(3, M) m."""
        regressor = self.landmarks.regressor.tocsc()[:, self._used]
        return self._surface.expression @ cs.MX(cs.DM(regressor.T.tocsc()))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the body's free arrays."""
        return _blocks(self)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return _tree(self)

    @property
    def labels(self) -> tuple[str, ...]:
        """The landmarks' names."""
        return self.landmarks.names

    @cached_property
    def numeric(self) -> NumericLandmarks | None:
        """Where the surface has it."""
        carrying = self._surface.numeric
        if carrying is None:
            return None
        return NumericLandmarks(carrying, self.landmarks.regressor.tocsc()[:, self._used].tocsr())

    @cached_property
    def _used(self) -> list[int]:
        counts = np.diff(self.landmarks.regressor.tocsc().indptr)
        return [int(vertex) for vertex in np.flatnonzero(counts)]

    @cached_property
    def _surface(self) -> SurfacePoints:
        return SurfacePoints(self.body, self.arguments, self._used)


def _blocks(source: SurfacePoints | JointPoints | LandmarkPoints) -> tuple[Block, ...]:
    """The block behind each symbol, the body's own (with unit and labels) where it is one."""
    body = source.body
    read = source.expression if body.free else cs.veccat(*source.arguments)
    known = {b.symbol.__hash__(): b for b in body.known_blocks}
    return tuple(known.get(s.__hash__()) or Block.of(s) for s in cs.symvar(read))


def _tree(source: SurfacePoints | JointPoints | LandmarkPoints) -> Tree | None:
    """The tree behind a pose that is a plain block; a pose made of pieces has no single name."""
    pose, body = source.arguments[0], source.body
    return Tree(pose.name(), body.joint_names, body.parents) if pose.is_symbolic() else None
