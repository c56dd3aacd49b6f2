"""Three sources of points on a body: its surface, its joints, and landmarks on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, TypeVar

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.blocks import Block, ManyPoints, NumericPoints, Tree
from workbench.bodies import surface
from workbench.bodies.arithmetic import arithmetic_of
from workbench.bodies.body import Body
from workbench.bodies.many_joints import ManyJoints
from workbench.bodies.numeric_sources import Named, NumericLandmarks, NumericSurface
from workbench.bodies.pairs import Pairs
from workbench.errors import BadBody

if TYPE_CHECKING:
    from workbench.bodies.skinned import Landmarks, SkinnedBody

Array = NDArray[np.float64]
SomeBody = TypeVar("SomeBody", bound=Body)
MOVE_JOINTS = ("template", "shapedirs", "J_regressor")  # the arrays that joints are made from


@dataclass(frozen=True, eq=False)
class Arguments(Generic[SomeBody]):
    """A body, and what stands for its pose (3, K) rad, betas (B, 1) and trans (3, 1) m.

    Raises BadBody for what has another shape, or is no symbol or expression of symbols.
    """

    body: SomeBody
    pose: cs.MX
    betas: cs.MX
    trans: cs.MX

    def __post_init__(self) -> None:
        for block, given in zip(self.body.blocks(), self.symbols, strict=True):
            if not isinstance(given, cs.MX):
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol for {block.name}, not something of "
                    f"type {type(given).__name__}; take block.symbol for block in body.blocks(), "
                    "or give numbers to body.vertices"
                )
            if given.shape != block.symbol_shape:
                raise BadBody(
                    f"body {self.body.name!r} takes a symbol of shape {block.symbol_shape} for "
                    f"{block.name}, not {given.shape}; take block.symbol for block in body.blocks()"
                )

    @property
    def symbols(self) -> tuple[cs.MX, cs.MX, cs.MX]:
        """In the order that a body takes them."""
        return self.pose, self.betas, self.trans

    def blocks(self) -> tuple[Block, ...]:
        """The block behind each symbol, the body's own (with unit and labels) where it is one."""
        known = {b.symbol.__hash__(): b for b in self.body.known_blocks}
        read = cs.symvar(cs.veccat(*self.symbols))
        return tuple(known.get(s.__hash__()) or Block.of(s) for s in read)

    @property
    def tree(self) -> Tree | None:
        """Behind a pose that is a plain block; a pose made of pieces has no single name."""
        if not self.pose.is_symbolic():
            return None
        return Tree(self.pose.name(), self.body.joint_names, self.body.parents)

    @property
    def names(self) -> tuple[str, str, str] | None:
        """The three blocks' names, if these are three blocks and nothing else."""
        if not all(symbol.is_symbolic() for symbol in self.symbols):
            return None
        pose, betas, trans = (symbol.name() for symbol in self.symbols)
        # of one block in two roles the derivatives would have to be added
        return (pose, betas, trans) if len({pose, betas, trans}) == 3 else None


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Vertices of the posed surface, all or some."""

    at: Arguments[SkinnedBody]
    vertices: surface.Vertices

    @property
    def count(self) -> int:
        """N, or how many are chosen."""
        every, chosen = range(self.at.body.n_vertices), self.vertices
        return len(every[chosen] if isinstance(chosen, slice) else chosen)

    @cached_property
    def expression(self) -> cs.MX:
        """(3, N) m."""
        return surface.posed(self.at.body, *self.at.symbols, self.vertices)

    @property
    def lean(self) -> cs.MX:
        """The expression."""
        return self.expression

    @property
    def many(self) -> ManyPoints | None:
        """By matrix products, where the surface is arithmetic."""
        return None if self.numeric is None else self.numeric.many

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and every free array."""
        return (*self.at.blocks(), *self.at.body.free.values())

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        if isinstance(self.vertices, slice):
            return None
        return tuple(f"vertex {i}" for i in self.vertices)

    @cached_property
    def numeric(self) -> Named | None:
        """None if an argument is no plain block, or there is no arithmetic."""
        names, points = self.at.names, self.arithmetic
        return None if names is None or points is None else Named(points, *names)

    @cached_property
    def arithmetic(self) -> NumericSurface | None:
        """None if arrays are free or the body is not SMPL's."""
        body = self.at.body
        if body.free or not body.is_smpl:
            return None
        some = self.vertices if isinstance(self.vertices, slice) else list(self.vertices)
        return NumericSurface(body, some, arithmetic_of(body, self.vertices))


@dataclass(frozen=True, eq=False)
class JointPoints:
    """The posed joints: J'_k is where G_k puts joint k, not the regressor on posed vertices."""

    at: Arguments[SkinnedBody]

    @property
    def count(self) -> int:
        """K."""
        return self.at.body.n_joints

    @cached_property
    def expression(self) -> cs.MX:
        """(3, K) m."""
        posture = surface.posture(self.at.body, self.at.pose)
        _, joints = surface.motions(self.at.body, posture, self.at.betas)
        return joints + cs.repmat(self.at.trans, 1, self.count)

    @property
    def lean(self) -> cs.MX:
        """The expression."""
        return self.expression

    @property
    def many(self) -> ManyPoints | None:
        """Generation by generation; None if arrays are free, or an argument is no plain block."""
        names = self.at.names
        if names is None or self.at.body.free:
            return None
        joints = ManyJoints.of(self.at.body)

        def points(values: Mapping[str, Array]) -> Array:
            pose, betas, trans = (values[name] for name in names)
            return joints(pose, betas) + trans[:, None]

        return points

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and the free arrays that joints are made from."""
        free = (b for name, b in self.at.body.free.items() if name in MOVE_JOINTS)
        return (*self.at.blocks(), *free)

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...]:
        """The joints' names."""
        return self.at.body.joint_names

    @property
    def numeric(self) -> NumericPoints | None:
        """None: there are so few joints that the graph is as fast."""
        return None


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Weighted means of posed vertices; only the vertices that carry weight are posed."""

    at: Arguments[SkinnedBody]
    landmarks: Landmarks

    @property
    def count(self) -> int:
        """M."""
        return len(self.landmarks.names)

    @cached_property
    def expression(self) -> cs.MX:
        """(3, M) m."""
        regressor = self.landmarks.regressor.tocsc()[:, self._used]
        return self._surface.expression @ cs.MX(cs.DM(regressor.T.tocsc()))

    @property
    def lean(self) -> cs.MX:
        """One rest point for each joint that moves a landmark, instead of its vertices."""
        if self._surface.numeric is None:
            return self.expression
        body, at = self.at.body, surface.posture(self.at.body, self.at.pose)
        G, _ = surface.motions(body, at, self.at.betas)
        means = self._pairs.expression(G, body.features(at), self.at.betas)
        return means + cs.repmat(self.at.trans, 1, self.count)

    @property
    def many(self) -> ManyPoints | None:
        """Without the vertices, where the surface is arithmetic."""
        return None if self.numeric is None else self._many

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments, and every free array."""
        return (*self.at.blocks(), *self.at.body.free.values())

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...]:
        """The landmarks' names."""
        return self.landmarks.names

    @cached_property
    def numeric(self) -> Named | None:
        """Where the surface has it."""
        names, carrying = self.at.names, self._surface.arithmetic
        if names is None or carrying is None:
            return None
        return Named(NumericLandmarks(carrying, self._regressor), *names)

    def _many(self, values: Mapping[str, Array]) -> Array:
        pose, betas, trans = (values[name] for name in self.at.names or ())
        motions = self.at.body.kinematics.motions(pose, betas)
        return self._pairs.points(*motions, betas) + trans[:, None]

    @cached_property
    def _pairs(self) -> Pairs:
        return Pairs.of(self.at.body, self._used, self._regressor)

    @cached_property
    def _regressor(self) -> csr_array:
        """(M, those used)."""
        return self.landmarks.regressor.tocsc()[:, self._used].tocsr()

    @cached_property
    def _used(self) -> list[int]:
        counts = np.diff(self.landmarks.regressor.tocsc().indptr)
        return [int(vertex) for vertex in np.flatnonzero(counts)]

    @cached_property
    def _surface(self) -> SurfacePoints:
        return SurfacePoints(self.at, self._used)
