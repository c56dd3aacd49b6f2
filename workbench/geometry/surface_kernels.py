"""Closest places on a surface by compiled code, with the numbers of NumPy; see surface_tree.c."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array
from workbench.compiling import library_or_none, source_beside
from workbench.geometry.surface_boxes import ROWS, Boxes, widening
from workbench.geometry.surface_order import WIDE, Order
from workbench.geometry.surface_search import IN_NUMPY, Asked, Found, Way
from workbench.geometry.triangles import FLAT

NAME = "surface-tree"
EXACT = ("-O3", "-ffp-contract=off", "-fno-math-errno")  # the rounding of NumPy, loops as vectors
TRIED = 100  # triangles and points that a library is tried on

Word = NDArray[np.generic] | int | float | None


def quickest() -> Way:
    """The search by compiled code, or by NumPy where there is no compiler."""
    return compiled() or IN_NUMPY


@cache
def compiled() -> Way | None:
    """The search by compiled code, loaded once per process; None where there is no compiler."""
    source = source_beside(__package__, "surface_tree.c")
    found = library_or_none(NAME, source, _agrees, "closest points are found by NumPy", EXACT)
    if found is None:
        return None
    loaded = Loaded(found)
    return Way(loaded.boxes, loaded.search)


@dataclass(frozen=True, eq=False)
class Loaded:
    """Boxes and searches of a loaded library.

    Attributes:
        library: the compiled functions.
    """

    library: ctypes.CDLL

    def boxes(self, order: Order, vertices: Array) -> Boxes:
        """The boxes around vertices (N, 3) m, with the same numbers as `Boxes.of`."""
        F, levels = len(order.faces), order.levels
        triangles = np.empty((len(order.leaves), ROWS, WIDE))
        nodes = np.empty((sum(levels[:-1]), 6, WIDE))
        normals, areas, turns = np.empty((F, 3)), np.empty(F), np.empty((F, 3))
        where = (len(order.leaves), order.leaves, order.faces, order.rising, vertices)
        self._run("fit", *where, FLAT, triangles, normals, areas, turns)
        counts = np.array(levels, np.intp)
        self._run("enclose", len(levels), counts, triangles, widening(vertices), nodes)
        return Boxes(order, vertices, triangles, nodes, normals, areas, turns)

    def search(self, boxes: Boxes, asked: Asked) -> Found:
        """The closest triangle of each point, with the same numbers as `by_numpy`."""
        order, M = boxes.order, len(asked.points)
        found = Found(np.empty(M, np.int64), np.empty((M, 3)), np.empty(M), np.empty((M, 3)))
        offsets, features = np.cumsum((0, *order.levels), dtype=np.intp), order.features
        self._run(
            "closest",
            *(M, asked.points, asked.normals, float(asked.within) ** 2, float(asked.facing)),
            *(len(order.levels), offsets, order.leaves, boxes.triangles, boxes.nodes),
            *(boxes.normals, order.rising, order.faces, features.edges, features.n_edges),
            *(features.starts, features.corners, boxes.angles, len(order.faces)),
            *(found.faces, found.shares, found.squares, found.normals),
        )
        return found

    def _run(self, name: str, *words: Word) -> None:
        """A function of the library; arrays, which must be in one piece, by their addresses."""
        getattr(self.library, name)(*map(_word, words))


def _word(given: Word) -> ctypes.c_double | ctypes.c_ssize_t:
    if isinstance(given, float):
        return ctypes.c_double(given)
    if isinstance(given, np.ndarray):
        assert given.flags.c_contiguous
        return ctypes.c_ssize_t(given.ctypes.data)
    return ctypes.c_ssize_t(given or 0)


def _agrees(loaded: ctypes.CDLL) -> bool:
    """Whether the library says what NumPy says, about a few random triangles, some of them flat."""
    rng, way = np.random.default_rng(0), Loaded(loaded)
    vertices, faces = (
        rng.standard_normal((TRIED // 2, 3)),
        rng.integers(TRIED // 2, size=(TRIED, 3)),
    )
    faces = np.concatenate([faces, faces[::7, [1, 2, 0]]])
    order = Order.of(vertices, faces)
    boxes, expected = way.boxes(order, vertices), IN_NUMPY.boxes(order, vertices)
    points, normals = rng.standard_normal((2, TRIED, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tried = (Asked(points, 1.0, None, 0.0), Asked(points, np.inf, normals, 0.5))
    answers = [(way.search(boxes, asked), IN_NUMPY.search(expected, asked)) for asked in tried]
    return all(
        np.array_equal(getattr(got, name), getattr(right, name))
        for got, right in ((boxes, expected), *answers)
        for name in (
            "triangles",
            "nodes",
            "normals",
            "areas",
            "turns",
            "faces",
            "shares",
            "squares",
        )
        if hasattr(got, name)
    )
