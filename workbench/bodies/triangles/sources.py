"""Where the points of a triangle body come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, kron

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.functions import sparse_constant
from workbench.bodies.forward.named_points import BlockPoints, BodyPoints, BodyPointsAt
from workbench.bodies.forward.rows import RowTarget, write
from workbench.bodies.forward.sources import Arguments, BodySource
from workbench.bodies.triangles import surface
from workbench.bodies.triangles.arithmetic import TriangleArithmetic
from workbench.bodies.triangles.means import StitchedMeans

FEW = 6  # vertices for each mean, from which on the whole surface costs more than the means


def surface_points(
    at: Arguments, arithmetic: TriangleArithmetic, free: Mapping[str, Block]
) -> BodySource:
    """All vertices of the posed and stitched surface.

    In symbols, the stitching's two triangular solves are part of the graph. Where arrays of the
    body are `free`, the symbols are all that there is.
    """
    return BodySource(
        at,
        at.body.n_vertices,
        None,
        tuple(free.values()),
        lambda: surface.posed(arithmetic.packed, *at.symbols, free),
        lambda maps: None if free else BlockPoints(arithmetic, maps),
    )


def mean_points(
    at: Arguments,
    arithmetic: TriangleArithmetic,
    free: Mapping[str, Block],
    regressor: csr_array,
    names: tuple[str, ...],
) -> BodySource:
    """Weighted means of a surface's vertices, by a regressor (M, N): joints, landmarks, vertices.

    Joints of a surface that deforms are on no rigid bones.
    """

    def express() -> cs.MX:
        vertices = surface.posed(arithmetic.packed, *at.symbols, free)
        return vertices @ cs.MX(sparse_constant(regressor.T))

    return BodySource(
        at,
        len(names),
        names,
        tuple(free.values()),
        express,
        lambda maps: None if free else BlockPoints(NumericMeans(arithmetic, regressor), maps),
        rigid_bones=False,
    )


@dataclass(frozen=True, eq=False)
class NumericMeans(BodyPoints):
    """Weighted means of the points of a surface: `regressor` (M, N); see BodyPoints."""

    surface: TriangleArithmetic
    regressor: csr_array

    @cached_property
    def on_coordinates(self) -> csr_array:
        """The matrix of weighted means, for each coordinate: (3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def evaluate(self, pose: Array, betas: Array, trans: Array, *_: Array) -> MeansAt:
        """The means at one pose, betas and translation."""
        return MeansAt(self, self.surface.evaluate(pose, betas, trans))

    def evaluate_batch(self, poses: Array, betas: Array, trans: Array, *_: Array) -> Array:
        """The means (M, L, 3) m of M poses, betas and translations."""
        if self.regressor.shape[0] * FEW <= self.regressor.shape[1]:
            return self._without_surface(poses, betas, trans)
        whole = self.surface.evaluate_batch(poses, betas, trans)
        return np.array([self.regressor @ points for points in whole])

    @cached_property
    def _without_surface(self) -> StitchedMeans:
        return StitchedMeans(self.surface.packed, self.regressor)


@dataclass(frozen=True, eq=False)
class MeansAt(BodyPointsAt):
    """The means at one pose, betas and trans; see BodyPointsAt."""

    of: NumericMeans
    surface: BodyPointsAt

    @cached_property
    def points(self) -> Array:
        """The weighted means of the posed vertices, (M, 3) m."""
        return np.asarray(self.of.regressor @ self.surface.points)

    def write_jacobian(self, into: Mapping[str, RowTarget], scale: Array | None) -> None:
        """Write the transposed derivative into `pose`, `betas` and `trans`, (size, 3 M) each."""
        N = self.of.regressor.shape[1]
        whole = {name: np.empty((len(target), 3 * N)) for name, target in into.items()}
        self.surface.write_jacobian(whole, None)
        for name, target in into.items():
            write(target, (self.of.on_coordinates @ whole[name].T).T, scale)

    def vjp(self, cotangent: Array) -> dict[str, Array]:
        """The gradients of cotangent (3 M,) . points by `pose`, `betas` and `trans`, flat."""
        return self.surface.vjp(self.of.on_coordinates.T @ cotangent)
