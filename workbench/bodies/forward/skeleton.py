"""A person's joints at rest, as a function of betas: the one place where it is written."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.arrays import SkinnedArrays
from workbench.geometry.rotation import Matrix


@dataclass(frozen=True, eq=False)
class Skeleton:
    """J(beta) = J_regressor (T + B_S(beta)) = mean + slopes beta (SMPL eq. 10).

    These arrays do not depend on the number of vertices. If a body's joints are given, they do not
    depend on betas.

    Attributes:
        mean: (K, 3) m, the joints of the mean person.
        slopes: (K, 3, B) m per unit of betas.
    """

    mean: Array
    slopes: Array

    @staticmethod
    def of(body: SkinnedArrays) -> Skeleton:
        """The joints of a body whose arrays are numbers."""
        N, _, B = body.shapedirs.shape
        if body.rest_joints is not None:
            return Skeleton(body.rest_joints, np.zeros((*body.rest_joints.shape, B)))
        mean = np.asarray(body.J_regressor @ body.template)
        mean.flags.writeable = False  # it is shown as an array of the body
        slopes = np.asarray(body.J_regressor @ body.shapedirs.reshape(N, 3 * B))
        return Skeleton(mean, slopes.reshape(len(mean), 3, B))

    def positions(self, betas: Array) -> Array:
        """The joints of the person with these betas (B,), (K, 3) m."""
        return np.asarray(self.mean + self.slopes @ betas)

    def joints(self, betas: Matrix) -> Matrix:
        """The joints (3, K) m, for betas (B, 1) that are symbols or numbers of CasADi."""
        K, _, B = self.slopes.shape
        moved = cs.DM(self.slopes.reshape(3 * K, B)) @ betas
        return cs.reshape(moved, 3, K) + cs.DM(self.mean.T)
