"""The arrays of a triangle body, as the modules that compute with it see them."""

from typing import Protocol

from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.body import Body
from workbench.geometry.triangles import Stitching


class TriangleArrays(Body, Protocol):
    """N vertices, F faces, K joints, B betas; each face near J joints."""

    @property
    def n_faces(self) -> int:
        """F, the number of triangles."""

    @property
    def shapedirs(self) -> Array:
        """What one unit of each of the betas adds to a triangle's deformation, (F, 3, 3, B)."""

    @property
    def posedirs(self) -> Array:
        """What the twists of near joints add to a face's deformation, (F, 3, 3, 3 J) per rad."""

    @property
    def near(self) -> Index:
        """The joints whose twists each face feels, (F, J)."""

    @property
    def weights(self) -> csr_array:
        """How much each triangle belongs to each part, (F, K)."""

    @property
    def J_regressor(self) -> csr_array:
        """The joints as weighted means of vertices, (K, N)."""

    @property
    def stitching(self) -> Stitching:
        """How the triangles hang together."""
