"""Points on a body by arithmetic: in the body's own words, and under the names of a problem.

Arithmetic knows a pose, betas and a translation (`BodyPoints`). A problem knows blocks by the names
that it gives them. `Named` stands between the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, kron

from workbench.blocks import PointsAt
from workbench.bodies.arithmetic import Arithmetic, Surface
from workbench.bodies.numeric import Chunk, chunks_of, many_points

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

Array = NDArray[np.float64]


class BodyPoints(Protocol):
    """Points on a body by arithmetic on its pose, betas and translation."""

    def at(self, pose: Array, betas: Array, trans: Array) -> PointsAt:
        """The points at pose (K, 3) rad, betas (B,) and trans (3,) m.

        Derivatives go by the names `pose`, `betas` and `trans`.
        """

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, N, 3) m of M poses (M, K, 3) rad, betas (M, B) and translations (M, 3) m."""


@dataclass(frozen=True, eq=False)
class Named:
    """Points on a body under a problem's names of its three blocks; see NumericPoints."""

    points: BodyPoints
    pose: str
    betas: str
    trans: str

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.pose, self.betas, self.trans

    def at(self, values: Mapping[str, Array]) -> NamedAt:
        """Where pose, betas and trans have these values."""
        return NamedAt(self, self.points.at(*(values[name] for name in self.reads)))

    def many(self, values: Mapping[str, Array]) -> Array:
        """(M, N, 3) m."""
        return self.points.many(*(values[name] for name in self.reads))


@dataclass(frozen=True, eq=False)
class NamedAt:
    """The points at one set of values; see PointsAt."""

    of: Named
    here: PointsAt

    @property
    def points(self) -> Array:
        """(N, 3) m."""
        return self.here.points

    def tangent(self, into: Mapping[str, Array], scale: Array | None) -> None:
        """Transposed, into[block] (size, 3 N)."""
        ours = zip(("pose", "betas", "trans"), self.of.reads, strict=True)
        self.here.tangent({our: into[name] for our, name in ours if name in into}, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        found, of = self.here.adjoint(pull), self.of
        return {of.pose: found["pose"], of.betas: found["betas"], of.trans: found["trans"]}


@dataclass(frozen=True, eq=False)
class NumericSurface:
    """Vertices of a linearly blended body whose arrays are all numbers; see BodyPoints."""

    body: SkinnedBody
    vertices: slice | list[int]
    arithmetic: Arithmetic

    def at(self, pose: Array, betas: Array, trans: Array) -> SurfaceAt:
        """The vertices at one pose, betas and translation."""
        return SurfaceAt(self, pose, betas, trans)

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, N, 3) m, by matrix products."""
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
        """Transposed, into[name] (size, 3 N)."""
        slopes = self.of.body.kinematics.slopes(self.pose, self.betas)
        self.surface.tangent(slopes, into, scale)

    def adjoint(self, pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled = pull.reshape(-1, 3)
        on_G, on_features, on_betas = self.surface.adjoint(pulled)
        back = self.of.body.kinematics.adjoint(self.pose, self.betas, on_G, on_features)
        on_pose, through_joints = back
        return {
            "pose": on_pose.ravel(),
            "betas": on_betas + through_joints,
            "trans": pulled.sum(axis=0),
        }


@dataclass(frozen=True, eq=False)
class NumericLandmarks:
    """Weighted means of the points of a surface: `regressor` (M, N); see BodyPoints."""

    surface: BodyPoints
    regressor: csr_array

    @cached_property
    def on_coordinates(self) -> csr_array:
        """(3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def at(self, pose: Array, betas: Array, trans: Array) -> LandmarksAt:
        """The means at one pose, betas and translation."""
        return LandmarksAt(self, self.surface.at(pose, betas, trans))

    def many(self, pose: Array, betas: Array, trans: Array) -> Array:
        """(M, L, 3) m, from the surface's points."""
        whole = self.surface.many(pose, betas, trans)
        return np.array([self.regressor @ points for points in whole])


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
        """Transposed, into[name] (size, 3 M)."""
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
