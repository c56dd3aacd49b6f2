"""Closest places on a surface, found by a tree of boxes around its triangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from workbench.arrays import Array, Index
from workbench.errors import BadArgument, BadMesh
from workbench.geometry.meshes import Mesh
from workbench.geometry.surface_kernels import quickest
from workbench.geometry.surface_order import NONE, Order
from workbench.geometry.surface_search import Asked, Found, Way

FARTHEST = 1e70  # m: no coordinate is larger, so that products of four do not overflow
CANCELLED = 1e-9  # a sum of unit normals that is shorter says nothing


@dataclass(frozen=True, eq=False)
class Closest:
    """The places on a surface that are closest to M points.

    Attributes:
        faces: (M,) the triangle; -1 where there is none within the gate.
        shares: (M, 3) barycentric coordinates in it, none negative, sum one; 0 where there is none.
        points: (M, 3) m, the closest place; the point itself where there is none.
        distances: (M,) m, positive on the side that the surface's normals point to, else negative;
            the gate where there is none.
        normals: (M, 3) the unit normal of the surface at the place: the face's inside a face, the
            mean of the two faces' on an edge, and that of all around a vertex, weighted by their
            angles, so that the sign of the distance is right there too (Baerentzen and Aanaes,
            "Signed distance computation using the angle weighted pseudonormal", 2005). Zero where
            there is none.
    """

    faces: Index
    shares: Array
    points: Array
    distances: Array
    normals: Array


class SurfaceTree:
    """A triangle mesh that can be asked for the place closest to a point.

    vertices (N, 3) m, finite; faces (F, 3) vertices of each triangle. Triangles without area, and
    several in one place, are allowed. Raises BadMesh for other arrays and for a mesh without faces.

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> tree = SurfaceTree(corners, np.array([[0, 1, 2]]))
    >>> found = tree.closest(np.array([[0.25, 0.25, 0.5], [2.0, 0.0, 0.0]]))
    >>> found.points.tolist(), found.distances.tolist()
    ([[0.25, 0.25, 0.0], [1.0, 0.0, 0.0]], [0.5, 1.0])
    """

    def __init__(self, vertices: Array, faces: Index, way: Callable[[], Way] = quickest) -> None:
        mesh = Mesh(_places(vertices), _whole(faces))
        if not len(mesh.faces):
            raise BadMesh("a surface without faces has no closest places; give at least one")
        self._way = way  # a function, as a loaded library cannot be pickled
        self._boxes = way().boxes(Order.of(mesh.vertices, mesh.faces), mesh.vertices)

    def moved(self, vertices: Array) -> SurfaceTree:
        """The same triangles with vertices (N, 3) m elsewhere: boxes refitted, no new tree.

        Answers are those of a new tree. A search takes longer the less the surface resembles the
        one that the tree was made for. Raises BadMesh for another number of vertices, or some that
        are not finite.
        """
        order = self._boxes.order
        new = Mesh(_places(vertices), order.faces[:0]).vertices
        if len(new) != order.n_vertices:
            raise BadMesh(f"{len(new)} vertices cannot take the place of {order.n_vertices}")
        tree = object.__new__(SurfaceTree)
        tree._way, tree._boxes = self._way, self._way().boxes(order, new)
        return tree

    def closest(
        self,
        points: Array,
        within: float = inf,
        normals: Array | None = None,
        facing: float = 0.5,
    ) -> Closest:
        """The place closest to each of points (M, 3) m that is not farther than `within` m.

        With normals (M, 3), unit vectors, only those triangles count whose normal has a cosine of
        at least `facing` with the point's; for a triangle without area it is 0. Of several
        triangles that are equally close, the one with the lowest number is taken. Raises
        BadArgument for numbers that are not finite or of another shape.
        """
        p = _rows(points, "points")
        n = None if normals is None else _rows(normals, "normals")
        if n is not None and len(n) != len(p):
            raise BadArgument(f"there are {len(p)} points, but {len(n)} normals; give one for each")
        if not within >= 0:
            raise BadArgument(f"within is {within}, but must be a distance in m, not negative")
        if np.isnan(facing):
            raise BadArgument(f"facing is {facing}, but must be a cosine, from -1 to 1")
        found = self._way().search(self._boxes, Asked(p, float(within), n, float(facing)))
        return self._closest(p, float(within), found)

    def _closest(self, points: Array, within: float, found: Found) -> Closest:
        there = found.faces != NONE
        corners = self._boxes.vertices[self._boxes.order.faces[found.faces]]
        s = found.shares
        places = s[:, :1] * corners[:, 0] + s[:, 1:2] * corners[:, 1] + s[:, 2:] * corners[:, 2]
        places = np.where(there[:, None], places, points)
        length = _lengths(found.normals)
        cancelled = length <= CANCELLED
        own = np.where(there[:, None], self._boxes.normals[found.faces], 0)
        normals = np.where(
            cancelled[:, None], own, found.normals / np.where(cancelled, 1, length)[:, None]
        )
        away = points - places
        side = away[:, 0] * normals[:, 0] + away[:, 1] * normals[:, 1] + away[:, 2] * normals[:, 2]
        distances = np.where(there, np.sqrt(found.squares) * np.where(side < 0, -1, 1), within)
        return Closest(found.faces, found.shares, places, distances, normals)


def _lengths(vectors: Array) -> Array:
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def _places(vertices: Array) -> Array:
    try:
        given = np.array(vertices, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise BadMesh(f"vertices must be an array of real numbers: {error}") from error
    if (np.abs(given[np.isfinite(given)]) > FARTHEST).any():
        raise BadMesh(
            f"a vertex is farther than {FARTHEST:g} m from the origin; remove or repair it"
        )
    return given


def _whole(faces: Index) -> Index:
    given = np.asarray(faces)
    if given.dtype.kind not in "iu":
        raise BadMesh(f"faces are {given.dtype}, but must be whole numbers of vertices")
    return np.array(given, dtype=np.int64, order="C")


def _rows(given: Array, what: str) -> Array:
    try:
        array = np.ascontiguousarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadArgument(f"{what} must be an array of real numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise BadArgument(f"{what} have shape {array.shape}, but must be (M, 3)")
    right = (np.abs(array) <= FARTHEST).all(axis=1)
    if not right.all():
        bad = int(np.argmin(right))
        raise BadArgument(f"row {bad} of {what} is {array[bad].tolist()}; leave it out")
    return array
