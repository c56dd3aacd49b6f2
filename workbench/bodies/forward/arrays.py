"""The arrays of a skinned body, as the modules that compute with it see them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, TypeAlias

from workbench.arrays import Array

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

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


SkinnedArrays: TypeAlias = "SkinnedBody"
