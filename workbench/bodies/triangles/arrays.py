"""The arrays of a triangle body, as whoever computes with them asks for them."""

from collections.abc import Mapping
from typing import Any, Protocol

from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.body import Body
from workbench.bodies.landmarks import Landmarks
from workbench.geometry.stitching import Stitching


class TriangleArrays(Body, Protocol):
    """N vertices, F faces, K joints, B betas; each face near J joints."""

    @property
    def n_faces(self) -> int:
        """F, the number of triangles."""

    @property
    def template(self) -> Array:
        """The mean person at rest, (N, 3) m."""

    @property
    def faces(self) -> Index:
        """The corners of each triangle, (F, 3)."""

    @property
    def shapedirs(self) -> Array:
        """(F, 3, 3, B)."""

    @property
    def posedirs(self) -> Array:
        """(F, 3, 3, 3 J) per rad."""

    @property
    def near(self) -> Index:
        """(F, J)."""

    @property
    def weights(self) -> csr_array:
        """How much each triangle belongs to each part, (F, K)."""

    @property
    def J_regressor(self) -> csr_array:
        """The joints as weighted means of vertices, (K, N)."""

    @property
    def landmarks(self) -> Mapping[str, Landmarks]:
        """By the name of the set."""

    @property
    def extras(self) -> Mapping[str, NDArray[Any]]:
        """Arrays of its file that no expression reads."""

    @property
    def stitching(self) -> Stitching:
        """How the triangles hang together."""
