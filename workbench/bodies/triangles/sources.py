"""Where the points of a triangle body come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as cs
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.blocks import Block, ManyPoints, Tree
from workbench.bodies.numeric_sources import NumericLandmarks
from workbench.bodies.sources import Arguments
from workbench.bodies.triangles import surface
from workbench.bodies.triangles.arithmetic import Arithmetic, SurfaceNumbers

if TYPE_CHECKING:
    from workbench.bodies.triangles.body import TriangleBody

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """All vertices of the posed and stitched surface."""

    at: Arguments[TriangleBody]

    @property
    def count(self) -> int:
        """N."""
        return self.at.body.n_vertices

    @cached_property
    def expression(self) -> cs.MX:
        """(3, N) m; the stitching's two triangular solves are part of the graph."""
        return surface.posed(self.at.body, *self.at.symbols)

    @property
    def lean(self) -> cs.MX:
        """The expression."""
        return self.expression

    @property
    def many(self) -> ManyPoints | None:
        """One after the other, where there is arithmetic."""
        return None if self.numeric is None else self.numeric.many

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the arguments."""
        return self.at.blocks()

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return self.at.tree

    @property
    def labels(self) -> tuple[str, ...] | None:
        """Vertices have no names but their numbers."""
        return None

    @cached_property
    def numeric(self) -> NumericTriangles | None:
        """None if an argument is no plain block."""
        names = self.at.names
        return None if names is None else NumericTriangles(self.at.body.arithmetic, *names)


@dataclass(frozen=True, eq=False)
class SurfaceMeans:
    """Weighted means of a surface's vertices: `regressor` (M, N), one row per point."""

    surface: TriangleSurface
    regressor: csr_array
    labels: tuple[str, ...]

    @property
    def count(self) -> int:
        """M."""
        return len(self.labels)

    @cached_property
    def expression(self) -> cs.MX:
        """(3, M) m."""
        return self.surface.expression @ cs.MX(cs.DM(self.regressor.T.tocsc()))

    @property
    def lean(self) -> cs.MX:
        """The expression."""
        return self.expression

    @property
    def many(self) -> ManyPoints | None:
        """Where the surface has it."""
        whole = self.surface.many
        if whole is None:
            return None
        return lambda values: np.array([self.regressor @ points for points in whole(values)])

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Those of the surface: every point of it moves with every block."""
        return self.surface.blocks

    @property
    def tree(self) -> Tree | None:
        """The body's."""
        return self.surface.tree

    @cached_property
    def numeric(self) -> NumericLandmarks | None:
        """Where the surface has it."""
        whole = self.surface.numeric
        return None if whole is None else NumericLandmarks(whole, self.regressor)


@dataclass(frozen=True, eq=False)
class NumericTriangles:
    """A triangle body's vertices under the names a problem gives its blocks; see NumericPoints."""

    arithmetic: Arithmetic
    pose: str
    betas: str
    trans: str

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.pose, self.betas, self.trans

    def at(self, values: Mapping[str, Array]) -> TrianglesAt:
        """Where pose, betas and trans have these values."""
        surface = self.arithmetic.at(values[self.pose], values[self.betas])
        return TrianglesAt(self, surface, values[self.trans])

    def many(self, values: Mapping[str, Array]) -> Array:
        """(M, N, 3) m, one after the other."""
        columns = [values[name] for name in self.reads]
        each = [dict(zip(self.reads, row, strict=True)) for row in zip(*columns, strict=True)]
        return np.array([self.at(one).points for one in each])


@dataclass(frozen=True, eq=False)
class TrianglesAt:
    """The vertices at one pose, betas and trans (3,) m; see PointsAt."""

    of: NumericTriangles
    surface: SurfaceNumbers
    trans: Array

    @cached_property
    def points(self) -> Array:
        """(N, 3) m."""
        return self.surface.points + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 N)."""
        ours = {"pose": self.of.pose, "betas": self.of.betas, "trans": self.of.trans}
        self.surface.tangent({our: into[n] for our, n in ours.items() if n in into}, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled = pull.reshape(-1, 3)
        on_pose, on_betas = self.surface.adjoint(pulled)
        of = self.of
        return {of.pose: on_pose.ravel(), of.betas: on_betas, of.trans: pulled.sum(axis=0)}
