"""The reflection x -> -x of a body, its vertices and joints changing sides.

A rotation R of a joint becomes S R S of the joint on the other side, S = diag(-1, 1, 1);
a rotation vector, being axial, keeps its x and turns its y and z.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index

REFLECTION = np.array([-1.0, 1.0, 1.0])  # what becomes of a position (x, y, z)
AXIAL = np.array([1.0, -1.0, -1.0])  # what becomes of a rotation vector


def opposite(name: str) -> str:
    """The name on the other side: left_knee -> right_knee, head -> head."""
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)


def opposites(names: Sequence[str]) -> Index:
    """For each name the index of its opposite."""
    return np.array([list(names).index(opposite(name)) for name in names])


@dataclass(frozen=True, eq=False)
class Mirror:
    """For each vertex (N,) and each joint (K,), the one on the other side of the body."""

    vertices: Index
    joints: Index

    @cached_property
    def features(self) -> Index:
        """For each pose feature, the one on the other side of the body, (9 (K - 1),).

        Feature 9 (k - 1) + 3 r + c belongs to entry (r, c) of the rotation matrix of joint k.
        """
        return (9 * (self.joints[1:, None] - 1) + np.arange(9)).ravel()

    @cached_property
    def feature_signs(self) -> Array:
        """S R S changes the sign of the entries with one index x: (9 (K - 1),)."""
        return np.tile(np.outer(REFLECTION, REFLECTION).ravel(), len(self.joints) - 1)

    def points(self, points: Array) -> Array:
        """Points (..., N, 3) reflected."""
        reflected: Array = points[..., self.vertices, :] * REFLECTION
        return reflected

    def directions(self, directions: Array) -> Array:
        """Directions (N, 3, B) reflected."""
        reflected: Array = directions[self.vertices] * REFLECTION[:, None]
        return reflected

    def weights(self, weights: Array) -> Array:
        """Skinning weights (N, K) reflected."""
        return weights[self.vertices][:, self.joints]

    def posedirs(self, posedirs: Array) -> Array:
        """Pose blend shapes (N, 3, 9 (K - 1)) reflected."""
        return self.directions(posedirs)[:, :, self.features] * self.feature_signs
