"""Closest places on a surface, found by a tree of boxes around its triangles."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from workbench.arrays import Array, Index
from workbench.blocks.checks import reals
from workbench.compiling import library_or_none, source_beside
from workbench.errors import BadArgument, BadMesh
from workbench.geometry.meshes import Mesh
from workbench.geometry.surface_search import (
    IN_NUMPY,
    NONE,
    ROWS,
    WIDE,
    Query,
    SearchBackend,
    SearchResult,
    TreeBoxes,
    TriangleTree,
    dot,
    widening,
)
from workbench.geometry.triangles import FLAT

if TYPE_CHECKING:
    import trimesh

NAME = "surface-tree"
EXACT = ("-O3", "-ffp-contract=off", "-fno-math-errno")  # the rounding of NumPy, loops as vectors
N_TRIED = 100  # triangles and points that a library is tried on

Word = NDArray[np.generic] | int | float | None


def quickest() -> SearchBackend:
    """The search by compiled code, or by NumPy where there is no compiler."""
    return compiled() or IN_NUMPY


@cache
def compiled() -> SearchBackend | None:
    """The search by compiled code, loaded once per process; None where there is no compiler."""
    source = source_beside(__package__, "surface_tree.c")
    library = library_or_none(NAME, source, _agrees, "closest points are found by NumPy", EXACT)
    return None if library is None else _backend(library)


def _backend(library: ctypes.CDLL) -> SearchBackend:
    """Boxes and searches by a loaded library, with the same numbers as those by NumPy."""

    def run(name: str, *words: Word) -> None:  # arrays, which must be in one piece, by address
        getattr(library, name)(*map(_word, words))

    def boxes(order: TriangleTree, vertices: Array) -> TreeBoxes:
        F, levels = len(order.faces), order.levels
        triangles = np.empty((len(order.leaves), ROWS, WIDE))
        nodes = np.empty((sum(levels[:-1]), 6, WIDE))
        normals, areas, turns = np.empty((F, 3)), np.empty(F), np.empty((F, 3))
        where = (len(order.leaves), order.leaves, order.faces, order.rising, vertices)
        run("fit", *where, FLAT, triangles, normals, areas, turns)
        counts = np.array(levels, np.intp)
        run("enclose", len(levels), counts, triangles, widening(vertices), nodes)
        return TreeBoxes(order, vertices, triangles, nodes, normals, areas, turns)

    def search(boxes: TreeBoxes, query: Query) -> SearchResult:
        order, M = boxes.order, len(query.points)
        best = SearchResult(np.empty(M, np.int64), np.empty((M, 3)), np.empty(M), np.empty((M, 3)))
        offsets, features = np.cumsum((0, *order.levels), dtype=np.intp), order.features
        run(
            "closest",
            *(M, query.points, query.normals, float(query.within) ** 2, float(query.facing)),
            *(len(order.levels), offsets, order.leaves, boxes.triangles, boxes.nodes),
            *(boxes.normals, order.rising, order.faces, features.edges, features.n_edges),
            *(features.starts, features.corners, boxes.angles, len(order.faces)),
            *(best.faces, best.shares, best.squares, best.normals),
        )
        return best

    return SearchBackend(boxes, search)


def _word(word: Word) -> ctypes.c_double | ctypes.c_ssize_t:
    if isinstance(word, float):
        return ctypes.c_double(word)
    if isinstance(word, np.ndarray):
        assert word.flags.c_contiguous
        return ctypes.c_ssize_t(word.ctypes.data)
    return ctypes.c_ssize_t(word or 0)


def _agrees(library: ctypes.CDLL) -> bool:
    """Whether the library says what NumPy says, about a few random triangles, some of them flat."""
    rng, backend = np.random.default_rng(0), _backend(library)
    vertices = rng.standard_normal((N_TRIED // 2, 3))
    faces = rng.integers(N_TRIED // 2, size=(N_TRIED, 3))
    order = TriangleTree.of(vertices, np.concatenate([faces, faces[::7, [1, 2, 0]]]))
    boxes, expected = backend.boxes(order, vertices), IN_NUMPY.boxes(order, vertices)
    points, normals = rng.standard_normal((2, N_TRIED, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    queries = (Query(points, 1.0, None, 0.0), Query(points, np.inf, normals, 0.5))
    answers: list[tuple[Any, Any]] = [(boxes, expected)]
    answers += [(backend.search(boxes, q), IN_NUMPY.search(expected, q)) for q in queries]
    return all(
        np.array_equal(getattr(ours, field.name), getattr(theirs, field.name))
        for ours, theirs in answers
        for field in fields(theirs)
        if field.name != "order"
    )


FARTHEST = 1e70  # m: no coordinate is larger, so that products of four do not overflow
SHORTEST_NORMAL = 1e-9  # a sum of unit normals that is shorter says nothing


@dataclass(frozen=True, eq=False)
class ClosestPoints:
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

    It is a Mesh, a `trimesh.Trimesh`, or finite vertices (N, 3) m and faces (F, 3). Triangles
    without area, and several in one place, are allowed. Raises BadMesh for other arrays and for a
    mesh without faces.

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> tree = SurfaceTree(corners, np.array([[0, 1, 2]]))
    >>> found = tree.closest(np.array([[0.25, 0.25, 0.5], [2.0, 0.0, 0.0]]))
    >>> found.points.tolist(), found.distances.tolist()
    ([[0.25, 0.25, 0.0], [1.0, 0.0, 0.0]], [0.5, 1.0])
    """

    def __init__(
        self,
        mesh: Mesh | trimesh.Trimesh | Array,
        faces: Index | None = None,
        find_backend: Callable[[], SearchBackend] = quickest,
    ) -> None:
        mesh = Mesh.of(mesh, faces)
        if not len(mesh.faces):
            raise BadMesh("a surface without faces has no closest places; give at least one")
        vertices = _checked_copy(mesh.vertices)
        self._find_backend = find_backend  # a function, as a loaded library cannot be pickled
        self._boxes = find_backend().boxes(TriangleTree.of(vertices, mesh.faces), vertices)

    def moved(self, vertices: Array) -> SurfaceTree:
        """The same triangles with vertices (N, 3) m elsewhere: boxes refitted, no new tree.

        Answers are those of a new tree. A search takes longer the less the surface resembles the
        one that the tree was made for. Raises BadMesh for another number of vertices, or some that
        are not finite.
        """
        order = self._boxes.order
        new = _checked_copy(Mesh.of(vertices, order.faces[:0]).vertices)
        if len(new) != order.n_vertices:
            raise BadMesh(f"{len(new)} vertices cannot take the place of {order.n_vertices}")
        tree = object.__new__(SurfaceTree)
        tree._find_backend, tree._boxes = self._find_backend, self._find_backend().boxes(order, new)
        return tree

    def closest(
        self,
        points: Array,
        within: float = inf,
        normals: Array | None = None,
        facing: float = 0.5,
    ) -> ClosestPoints:
        """The place closest to each of points (M, 3) m that is not farther than `within` m.

        With normals (M, 3), unit vectors, only those triangles count whose normal has a cosine of
        at least `facing` with the point's; for a triangle without area it is 0. Of several
        triangles that are equally close, the one with the lowest number is taken. Raises
        BadArgument for numbers that are not finite or of another shape, and NotNumbers.
        """
        p = _checked_rows(points, "points")
        n = None if normals is None else _checked_rows(normals, "normals")
        if n is not None and len(n) != len(p):
            raise BadArgument(f"there are {len(p)} points, but {len(n)} normals; give one for each")
        if not within >= 0:
            raise BadArgument(f"within is {within}, but must be a distance in m, not negative")
        if np.isnan(facing):
            raise BadArgument(f"facing is {facing}, but must be a cosine, from -1 to 1")
        boxes, gate = self._boxes, float(within)
        best = self._find_backend().search(boxes, Query(p, gate, n, float(facing)))
        exists, s = best.faces != NONE, best.shares
        corners = boxes.vertices[boxes.order.faces[best.faces]]
        places = s[:, :1] * corners[:, 0] + s[:, 1:2] * corners[:, 1] + s[:, 2:] * corners[:, 2]
        places = np.where(exists[:, None], places, p)
        length = np.sqrt(dot(best.normals.T, best.normals.T))[:, None]
        face_normals = np.where(exists[:, None], boxes.normals[best.faces], 0)
        cancelled = length <= SHORTEST_NORMAL
        surface = np.where(cancelled, face_normals, best.normals / np.where(cancelled, 1, length))
        side = np.where(dot((p - places).T, surface.T) < 0, -1, 1)
        distances = np.where(exists, np.sqrt(best.squares) * side, gate)
        return ClosestPoints(best.faces, s, places, distances, surface)


def _checked_copy(vertices: Array) -> Array:
    if (np.abs(vertices) > FARTHEST).any():
        raise BadMesh(
            f"a vertex is farther than {FARTHEST:g} m from the origin; remove or repair it"
        )
    return np.array(vertices, dtype=np.float64, order="C")


def _checked_rows(points: Array, what: str) -> Array:
    array = np.ascontiguousarray(reals(what, points))
    if array.ndim != 2 or array.shape[1] != 3:
        raise BadArgument(f"{what} have shape {array.shape}, but must be (M, 3)")
    right = (np.abs(array) <= FARTHEST).all(axis=1)
    if not right.all():
        bad = int(np.argmin(right))
        raise BadArgument(f"row {bad} of {what} is {array[bad].tolist()}; leave it out")
    return array


AT_VERTEX = 1e-5  # m: a point nearer to a vertex follows it alone


def nearest(vertices: Array, points: Array) -> tuple[Array, Index]:
    """The distance of each point (M, 3) from the nearest vertex, and that vertex, (M,) both."""
    distances, numbers = cKDTree(vertices).query(points)
    return np.asarray(distances, np.float64), np.asarray(numbers, np.int64)


def closest(
    points: Array, mesh: Mesh | trimesh.Trimesh, within: float = inf, normals: Array | None = None
) -> ClosestPoints:
    """The place on a mesh closest to each of points (M, 3) m; see `SurfaceTree.closest`.

    A mesh that is asked more than once is better made a `SurfaceTree` first.
    """
    return SurfaceTree(mesh).closest(points, within, normals)


def barycentric_weights(vertices: Array, faces: Index, points: Array) -> csr_array:
    """Each point (M, 3) m as the mean of the corners of the closest triangle: (M, N).

    Rows sum to one. A point at a vertex (N, 3) m follows that vertex alone.
    """
    places = SurfaceTree(vertices, faces).closest(points)
    corners, shares = faces[places.faces], places.shares
    distance, vertex = nearest(vertices, points)
    same = distance < AT_VERTEX
    corners[same], shares[same] = vertex[same, None], [1.0, 0.0, 0.0]
    shares[shares < 1e-6] = 0
    shares /= shares.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 3)
    shape = len(points), len(vertices)
    return csr_array((shares.ravel(), (rows, corners.ravel())), shape=shape)
