"""Where the points of a triangle body come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as cs
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks import Block, Tree
from workbench.bodies.forward.arguments import Arguments
from workbench.bodies.forward.numeric_sources import Named, NumericMeans
from workbench.bodies.triangles import surface
from workbench.bodies.triangles.arithmetic import Arithmetic, SurfaceNumbers
from workbench.bodies.triangles.arrays import TriangleArrays
from workbench.bodies.triangles.many import ManySurfaces


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """All vertices of the posed and stitched surface."""

    at: Arguments[TriangleArrays]
    arrays: Arithmetic

    @property
    def count(self) -> int:
        """N, the number of vertices."""
        return self.at.body.n_vertices

    @cached_property
    def expression(self) -> cs.MX:
        """(3, N) m; the stitching's two triangular solves are part of the graph."""
        return surface.posed(self.at.body, self.arrays, *self.at.symbols)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments."""
        return self.at.blocks()

    @property
    def tree(self) -> Tree | None:
        """The kinematic tree of the body."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        return None

    @cached_property
    def numeric(self) -> Named | None:
        """None if an argument is no affine map of blocks."""
        maps = self.at.maps
        return None if maps is None else Named(self.arithmetic, maps)

    @cached_property
    def arithmetic(self) -> NumericTriangles:
        """The vertices in numbers."""
        return NumericTriangles(self.arrays)


@dataclass(frozen=True, eq=False)
class SurfaceMeans:
    """Weighted means of a surface's vertices: `regressor` (M, N), one row per point."""

    surface: TriangleSurface
    regressor: csr_array
    labels: tuple[str, ...]

    @property
    def count(self) -> int:
        """M, the number of weighted means."""
        return len(self.labels)

    @cached_property
    def expression(self) -> cs.MX:
        """The weighted means of vertices in symbols, (3, M) m."""
        return self.surface.expression @ cs.MX(cs.DM(self.regressor.T.tocsc()))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the surface: every point of it moves with every block."""
        return self.surface.blocks

    @property
    def tree(self) -> Tree | None:
        """The body's; the joints of a surface that deforms are on no rigid bones."""
        tree = self.surface.tree
        return None if tree is None else replace(tree, rigid_bones=False)

    @cached_property
    def numeric(self) -> Named | None:
        """Where the surface has it."""
        maps = self.surface.at.maps
        if maps is None:
            return None
        return Named(NumericMeans(self.surface.arithmetic, self.regressor), maps)


@dataclass(frozen=True, eq=False)
class NumericTriangles:
    """A triangle body's vertices by arithmetic; see BodyPoints."""

    arithmetic: Arithmetic

    def at(self, pose: Array, betas: Array, trans: Array) -> TrianglesAt:
        """The vertices at one pose, betas and translation."""
        return TrianglesAt(self.arithmetic.at(pose, betas), trans)

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, N, 3) m, all at once."""
        return self._many(pose, betas) + trans[:, None]

    @cached_property
    def _many(self) -> ManySurfaces:
        return ManySurfaces(self.arithmetic)


@dataclass(frozen=True, eq=False)
class TrianglesAt:
    """The vertices at one pose, betas and trans (3,) m; see PointsAt."""

    surface: SurfaceNumbers
    trans: Array

    @cached_property
    def points(self) -> Array:
        """The stitched vertices, (N, 3) m."""
        return self.surface.points + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[name] (size, 3 N)."""
        self.surface.tangent(into, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled = pull.reshape(-1, 3)
        on_pose, on_betas = self.surface.adjoint(pulled)
        return {"pose": on_pose.ravel(), "betas": on_betas, "trans": pulled.sum(axis=0)}
