"""Points on a body by arithmetic, under the names that a problem gives to pose, betas and trans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, kron

from workbench.blocks import NumericPoints, PointsAt
from workbench.bodies.arithmetic import Arithmetic, Surface
from workbench.bodies.numeric import Chunk, chunks_of, many_points

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NumericSurface:
    """Vertices of a linearly blended body whose arrays are all numbers; see NumericPoints."""

    body: SkinnedBody
    vertices: slice | list[int]
    arithmetic: Arithmetic
    pose: str
    betas: str
    trans: str

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.pose, self.betas, self.trans

    def at(self, values: Mapping[str, Array]) -> SurfaceAt:
        """Where pose, betas and trans have these values."""
        return SurfaceAt(self, values[self.pose], values[self.betas], values[self.trans])

    def many(self, values: Mapping[str, Array]) -> Array:
        """(M, N, 3) m, by matrix products."""
        pose, betas, trans = (values[name] for name in self.reads)
        G, features = self.body.kinematics.motions(pose, betas)
        found = many_points(self._chunks, G, features, betas)
        found += trans[:, None]
        return found

    @cached_property
    def _chunks(self) -> list[Chunk]:
        whole = self.vertices == slice(None)
        return self.body.chunks if whole else chunks_of(self.body, self.vertices)


@dataclass(frozen=True, eq=False)
class SurfaceAt:
    """The vertices at one pose (K, 3) rad, betas (B,) and trans (3,) m; see PointsAt."""

    of: NumericSurface
    pose: Array
    betas: Array
    trans: Array

    @cached_property
    def surface(self) -> Surface:
        """The surface before translation."""
        motion = self.of.body.kinematics.motion(self.pose, self.betas)
        return self.of.arithmetic.at(motion, self.betas)

    @cached_property
    def points(self) -> Array:
        """(N, 3) m."""
        return self.surface.points + self.trans

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 N)."""
        of = self.of
        ours = {"pose": of.pose, "betas": of.betas, "trans": of.trans}
        wanted = {our: into[name] for our, name in ours.items() if name in into}
        slopes = of.body.kinematics.slopes(self.pose, self.betas)
        self.surface.tangent(slopes, wanted, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled, of = pull.reshape(-1, 3), self.of
        on_G, on_features, on_betas = self.surface.adjoint(pulled)
        back = of.body.kinematics.adjoint(self.pose, self.betas, on_G, on_features)
        on_pose, through_joints = back
        return {
            of.pose: on_pose.ravel(),
            of.betas: on_betas + through_joints,
            of.trans: pulled.sum(axis=0),
        }


@dataclass(frozen=True, eq=False)
class NumericLandmarks:
    """Weighted means of the points of a surface: `regressor` (M, N)."""

    surface: NumericPoints
    regressor: csr_array

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.surface.reads

    @cached_property
    def on_coordinates(self) -> csr_array:
        """(3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def at(self, values: Mapping[str, Array]) -> LandmarksAt:
        """Where pose, betas and trans have these values."""
        return LandmarksAt(self, self.surface.at(values))


@dataclass(frozen=True, eq=False)
class LandmarksAt:
    """The means at one pose, betas and trans; see PointsAt."""

    of: NumericLandmarks
    surface: PointsAt

    @cached_property
    def points(self) -> Array:
        """(M, 3) m."""
        return np.asarray(self.of.regressor @ self.surface.points)

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 M)."""
        N = self.of.regressor.shape[1]
        whole = {name: np.empty((len(a), 3 * N)) for name, a in into.items()}
        self.surface.tangent(whole, None)
        for name, array in into.items():
            array[...] = (self.of.on_coordinates @ whole[name].T).T
            if scale is not None:
                array *= scale

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        return self.surface.adjoint(self.of.on_coordinates.T @ pull)
