"""A surface where its vertices are now: its triangles as searches read them, in boxes of boxes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array
from workbench.geometry.surface_order import NONE, WIDE, Order
from workbench.geometry.triangles import FLAT

ROWS = 18  # numbers of a triangle: corners a, b, c (9), 1 / |edge|^2 of ab, ac, bc (3), slopes (6)
FAR = 1e150  # m: where there are no triangles; its square is still finite
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
    """

    order: Order
    vertices: Array
    triangles: Array
    nodes: Array
    normals: Array

    @staticmethod
    def of(order: Order, vertices: Array) -> Boxes:
        """The boxes around vertices (N, 3) m."""
        rising = np.take_along_axis(order.faces, order.rising, axis=1)
        there = order.leaves != NONE
        corners = np.where(there, rising.T[:, order.leaves], 0)  # (3, L, WIDE)
        a, b, c = (np.ascontiguousarray(vertices.T)[:, corner] for corner in corners)
        ab, ac, bc = b - a, c - a, c - b
        n = _cross(ab, ac)
        squares = np.stack([_dot(edge, edge) for edge in (ab, ac, bc)])
        area = np.sqrt(_dot(n, n))
        flat = ~(area > FLAT * squares.max(axis=0))
        n[:, flat] = 0
        area[flat] = 1
        with np.errstate(divide="ignore", over="ignore"):
            inverses = np.where(squares > 0, 1 / squares, 0)
        n /= area
        slopes = np.stack([_cross(ac, n), _cross(n, ab)]) / area
        triangles = np.empty((len(order.leaves), ROWS, WIDE))
        for row, values in enumerate([*a, *b, *c, *inverses, *slopes[0], *slopes[1]]):
            triangles[:, row] = np.where(there, values, FAR if row < 9 else 0)
        swapped = (order.rising[:, 1] - order.rising[:, 0]) % 3 != 1  # an odd permutation
        sign = np.where(swapped, -1.0, 1.0)
        normals = n.reshape(3, -1)[:, order.lanes].T * sign[:, None]
        low = np.where(there, np.minimum(np.minimum(a, b), c), FAR).min(axis=2)
        high = np.where(there, np.maximum(np.maximum(a, b), c), -FAR).max(axis=2)
        wide = MARGIN * np.abs(vertices).max()
        nodes = _nodes(order.levels, low - wide, high + wide)
        return Boxes(order, vertices, triangles, nodes, np.ascontiguousarray(normals))

    @cached_property
    def angles(self) -> Array:
        """The angle at every corner of every face, (F, 3); 0 where an edge has no length."""
        corners = [np.ascontiguousarray(self.vertices[i].T) for i in self.order.faces.T]
        x, y, z = (corners[(k + 1) % 3] - corners[k] for k in range(3))  # x + y + z = 0
        n = _cross(x, y)
        area = np.sqrt(_dot(n, n))
        beside = ((z, x), (x, y), (y, z))
        return np.stack([np.arctan2(area, -_dot(p, q)) for p, q in beside], axis=1)


def _nodes(levels: tuple[int, ...], low: Array, high: Array) -> Array:
    """The boxes of the children of all nodes, from those of the leaves, (3, L) both."""
    found = []
    for count in reversed(levels[:-1]):
        missing = ((0, 0), (0, count * WIDE - low.shape[1]))
        low = np.pad(low, missing, constant_values=FAR).reshape(3, count, WIDE)
        high = np.pad(high, missing, constant_values=-FAR).reshape(3, count, WIDE)
        found.insert(0, np.concatenate([low, high]).transpose(1, 0, 2))
        low, high = low.min(axis=2), high.max(axis=2)
    return np.ascontiguousarray(np.concatenate(found))


def _dot(x: Array, y: Array) -> Array:
    found: Array = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    return found


def _cross(x: Array, y: Array) -> Array:
    return np.stack(
        [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    )
