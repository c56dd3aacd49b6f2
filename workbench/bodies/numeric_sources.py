"""Points on a body by arithmetic, under the names that a problem gives to pose, betas and trans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, kron

from workbench.bodies.arithmetic import Arithmetic
from workbench.bodies.motion import Motion

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NumericSurface:
    """Vertices of a linearly blended body whose arrays are all numbers; see NumericPoints."""

    body: SkinnedBody
    arithmetic: Arithmetic
    pose: str
    betas: str
    trans: str

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.pose, self.betas, self.trans

    def points(self, values: Mapping[str, Array]) -> Array:
        """(N, 3) m."""
        motion = self._motion(values)
        return self.arithmetic.points(motion, values[self.betas]) + values[self.trans]

    def tangent(
        self,
        values: Mapping[str, Array],
        into: Mapping[str, Array],
        scale: Array | None,
        points: Array | None = None,
    ) -> None:
        """Transposed, into[block] (size, 3 N)."""
        ours = {"pose": self.pose, "betas": self.betas, "trans": self.trans}
        wanted = {our: into[name] for our, name in ours.items() if name in into}
        motion, betas = self._motion(values), values[self.betas]
        slopes = self.body.kinematics.slopes(values[self.pose], betas)
        self.arithmetic.tangent(motion, slopes, betas, wanted, scale, points)
        if points is not None:
            points += values[self.trans]

    def adjoint(self, values: Mapping[str, Array], pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        pulled, pose, betas = pull.reshape(-1, 3), values[self.pose], values[self.betas]
        felt = self.arithmetic.adjoint(self._motion(values), betas, pulled)
        on_G, on_features, on_betas = felt
        on_pose, through_joints = self.body.kinematics.adjoint(pose, betas, on_G, on_features)
        return {
            self.pose: on_pose.ravel(),
            self.betas: on_betas + through_joints,
            self.trans: pulled.sum(axis=0),
        }

    def _motion(self, values: Mapping[str, Array]) -> Motion:
        return self.body.kinematics.motion(values[self.pose], values[self.betas])


@dataclass(frozen=True, eq=False)
class NumericLandmarks:
    """Weighted means of the points of a surface: `regressor` (M, N)."""

    surface: NumericSurface
    regressor: csr_array

    @property
    def reads(self) -> tuple[str, ...]:
        """Pose, betas and trans by their names in the problem."""
        return self.surface.reads

    @cached_property
    def _on_coordinates(self) -> csr_array:
        """(3 M, 3 N)."""
        return csr_array(kron(self.regressor, np.eye(3), format="csr"))

    def points(self, values: Mapping[str, Array]) -> Array:
        """(M, 3) m."""
        return np.asarray(self.regressor @ self.surface.points(values))

    def tangent(
        self,
        values: Mapping[str, Array],
        into: Mapping[str, Array],
        scale: Array | None,
        points: Array | None = None,
    ) -> None:
        """Transposed, into[block] (size, 3 M)."""
        N = self.regressor.shape[1]
        whole = {name: np.empty((len(a), 3 * N)) for name, a in into.items()}
        vertices = None if points is None else np.empty((N, 3))
        self.surface.tangent(values, whole, None, vertices)
        if points is not None and vertices is not None:
            points[...] = self.regressor @ vertices
        for name, array in into.items():
            array[...] = (self._on_coordinates @ whole[name].T).T
            if scale is not None:
                array *= scale

    def adjoint(self, values: Mapping[str, Array], pull: Array) -> dict[str, Array]:
        """By pose, betas and trans, flat."""
        return self.surface.adjoint(values, self._on_coordinates.T @ pull)
