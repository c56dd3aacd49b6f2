"""The arrays of a skinned body, as the modules that compute with it see them.

Modules below `SkinnedBody` are written in these protocols, so that none of them imports it.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol

from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.bodies.body import Body
from workbench.bodies.forward.features import Features
from workbench.bodies.forward.skinning import Skinning

Vertices = Sequence[int] | slice
ALL = slice(None)


class SurfaceArrays(Protocol):
    """What a body's surface is made of; N vertices, K joints, B betas."""

    @property
    def template(self) -> Array:
        """The vertices of the mean person at rest, (N, 3) m."""

    @property
    def shapedirs(self) -> Array:
        """What one standard deviation of each beta adds to the template, (N, 3, B) m."""

    @property
    def posedirs(self) -> Array:
        """What one unit of each pose feature adds to them, (N, 3, 9 (K - 1)) m."""

    @property
    def weights(self) -> Array:
        """How much each joint moves each vertex, (N, K); rows sum to one."""


class SkinnedArrays(SurfaceArrays, Body, Protocol):
    """The arrays of a skinned body, the functions that combine them, and which are free."""

    @property
    def J_regressor(self) -> csr_array:
        """The joints at rest as weighted means of vertices, (K, N); rows sum to one."""

    @property
    def rest_joints(self) -> Array | None:
        """(K, 3) m, the joints at rest if they are given; None if `J_regressor` computes them."""

    @property
    def skinning(self) -> Skinning:
        """The function that blends the motions of joints."""

    @property
    def features(self) -> Features:
        """The function of the pose by which posedirs are multiplied."""

    @property
    def is_smpl(self) -> bool:
        """Whether skinning and pose features are SMPL's, for which there is fast arithmetic."""

    @property
    def free(self) -> Mapping[str, Block]:
        """The arrays that are unknowns, by name."""
