"""A tree of boxes around the triangles of a surface, fitted to where its vertices are now."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array
from workbench.geometry.surface_order import NONE, WIDE, Order
from workbench.geometry.triangles import FLAT

ROWS = 18  # numbers of a triangle: corners a, b, c (9), 1 / |edge|^2 of ab, ac, bc (3), slopes (6)
FAR = 1e150  # m: where there are no triangles; its square is still finite
TINY = 1e-300  # m^2: the square of an edge that counts as a point
MARGIN = 1e-14  # of the largest coordinate: boxes are wider by so much, more than rounding is


@dataclass(frozen=True, eq=False)
class Boxes:
    """The triangles and boxes of a tree.

    Attributes:
        order: which triangle is in which leaf.
        vertices: (N, 3) m.
        triangles: (L, ROWS, WIDE) the numbers of every leaf's triangles. The slopes of a triangle
            are those of its barycentric coordinates of b and c, along its plane; 0 if it is flat.
        nodes: (nodes, 6, WIDE) lower and upper corners of every node's children, from the root on.
        normals: (F, 3) unit normals; zero for a triangle without area.
        areas: (F,) m^2, twice the area of each triangle.
        turns: (F, 3) m^2, the product of the two edges that leave each corner.
    """

    order: Order
    vertices: Array
    triangles: Array
    nodes: Array
    normals: Array
    areas: Array
    turns: Array

    @staticmethod
    def of(order: Order, vertices: Array) -> Boxes:
        """The boxes around vertices (N, 3) m."""
        there = order.leaves != NONE
        corners = np.where(there, order.ends.T[:, order.leaves], 0)  # (3, L, WIDE)
        a, b, c = (np.ascontiguousarray(vertices.T)[:, corner] for corner in corners)
        u, v, w = b - a, c - a, c - b
        n = _cross(u, v)
        squares = np.stack([dot(edge, edge) for edge in (u, v, w)])
        area = np.sqrt(dot(n, n))
        flat = ~(area > FLAT * squares.max(axis=0))
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            inverses = np.where(squares > TINY, 1 / squares, 0)
            n = np.where(flat, 0, n / area)
            g, h = (np.where(flat, 0, _cross(*sides) / area) for sides in ((v, n), (n, u)))
        triangles = np.empty((len(order.leaves), ROWS, WIDE))
        for row, values in enumerate([*a, *b, *c, *inverses, *g, *h]):
            triangles[:, row] = np.where(there, values, FAR if row < 9 else 0)
        low = np.where(there, np.minimum(np.minimum(a, b), c), FAR).min(axis=2)
        high = np.where(there, np.maximum(np.maximum(a, b), c), -FAR).max(axis=2)
        wide = widening(vertices)
        nodes = _nodes(order.levels, low - wide, high + wide)
        even = (order.rising[:, 1] - order.rising[:, 0]) % 3 == 1
        normals = _by_face(order, n) * np.where(even, 1.0, -1.0)[:, None]
        turns, rising = (
            np.empty((len(order.faces), 3)),
            np.stack([dot(u, v), -dot(u, w), dot(v, w)]),
        )
        np.put_along_axis(turns, order.rising, _by_face(order, rising), axis=1)
        areas = _by_face(order, area[None])[:, 0]
        return Boxes(order, vertices, triangles, nodes, normals, areas, turns)

    @cached_property
    def angles(self) -> Array:
        """The angle at every corner of every face, (F, 3); 0 where an edge has no length."""
        return np.asarray(np.arctan2(self.areas[:, None], self.turns))


def widening(vertices: Array) -> float:
    """By how much boxes are wider than what is in them, m."""
    return float(MARGIN * np.abs(vertices).max())


def _by_face(order: Order, values: Array) -> Array:
    """(k, L, WIDE) -> (F, k)."""
    return np.ascontiguousarray(values.reshape(len(values), -1)[:, order.lanes].T)


def _nodes(levels: tuple[int, ...], low: Array, high: Array) -> Array:
    """The boxes of the children of all nodes, from those of the leaves, (3, L) both."""
    found: list[Array] = []
    for count in reversed(levels[:-1]):
        missing = ((0, 0), (0, count * WIDE - low.shape[1]))
        low = np.pad(low, missing, constant_values=FAR).reshape(3, count, WIDE)
        high = np.pad(high, missing, constant_values=-FAR).reshape(3, count, WIDE)
        found.insert(0, np.concatenate([low, high]).transpose(1, 0, 2))
        low, high = low.min(axis=2), high.max(axis=2)
    return np.ascontiguousarray(np.concatenate(found))


def dot(x: Array, y: Array) -> Array:
    """The products of vectors whose three coordinates come first."""
    found: Array = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    return found


def _cross(x: Array, y: Array) -> Array:
    return np.stack(
        [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    )
