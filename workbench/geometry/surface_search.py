"""Closest triangles of a mesh, found by a tree of boxes around them; here by NumPy.

The tree halves the triangles again and again, across the longest side of their centroids' box,
until at most WIDE are left in each leaf; three halvings make one step, so that a node has WIDE
children. All leaves are on one level, so that where a node's children are needs no pointers.
Neighbours in space are neighbours in memory. The tree is descended for many points at once, level
by level. Every formula is written so that compiled code can say the same to the last bit: sums of
three products from left to right, nothing that depends on how NumPy adds up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index, Mask
from workbench.geometry.triangles import FLAT

WIDE = 8  # triangles in a leaf, children of a node
NONE = -1  # in place of a face
CORNERS = ((1, 2), (2, 0), (0, 1))  # of a triangle's edges: edge k is opposite to corner k


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Which triangles of a mesh are in which leaf, whatever its vertices do.

    Attributes:
        faces: (F, 3) vertices of each triangle.
        n_vertices: how many vertices there are.
        leaves: (L, WIDE) faces in each leaf, in rising order, and NONE after them.
    """

    faces: Index
    n_vertices: int
    leaves: Index

    @staticmethod
    def of(vertices: Array, faces: Index) -> TriangleTree:
        """The order in which a mesh is split where its vertices are now."""
        F = len(faces)
        halvings = max(0, (-(-F // WIDE) - 1).bit_length())
        per_leaf = -(-F // 2**halvings)
        middles = np.full((2**halvings * per_leaf, 3), np.inf)
        middles[:F] = vertices[faces].mean(axis=1)
        order = np.arange(len(middles))[None]
        for _ in range(halvings):
            grouped = middles[order]
            low = grouped.min(axis=1)
            high = np.where(np.isfinite(grouped), grouped, -np.inf).max(axis=1)
            with np.errstate(invalid="ignore"):  # a group of no triangles
                axis = np.argmax(high - low, axis=1)
            along = np.take_along_axis(grouped, axis[:, None, None], axis=2)[..., 0]
            half = order.shape[1] // 2
            split = np.argpartition(along, half, axis=1)
            order = np.take_along_axis(order, split, axis=1).reshape(-1, half)
        order = np.sort(order, axis=1)
        leaves = np.full((len(order), WIDE), NONE)
        leaves[:, :per_leaf] = np.where(order < F, order, NONE)
        return TriangleTree(faces, len(vertices), leaves)

    @cached_property
    def levels(self) -> tuple[int, ...]:
        """The number of nodes on each level, from the root to the leaves."""
        counts = [len(self.leaves)]
        while counts[0] > 1 or len(counts) == 1:
            counts.insert(0, -(-counts[0] // WIDE))
        return tuple(counts)

    @cached_property
    def lanes(self) -> Index:
        """Where each face is in `leaves` when that is flat, (F,)."""
        lanes, filled = np.empty(len(self.faces), np.int64), self.leaves.ravel() != NONE
        lanes[self.leaves.ravel()[filled]] = np.flatnonzero(filled)
        return lanes

    @cached_property
    def rising(self) -> Index:
        """The corners 0, 1, 2 of each face by the numbers of their vertices, (F, 3).

        Taken in this order, an edge that two triangles share is computed from the same end in both.
        """
        return np.argsort(self.faces, axis=1, kind="stable")

    @cached_property
    def ends(self) -> Index:
        """The vertices of each face in rising order, (F, 3)."""
        return np.take_along_axis(self.faces, self.rising, axis=1)

    @cached_property
    def features(self) -> MeshAdjacency:
        """What the faces share."""
        return MeshAdjacency.of(self.faces, self.n_vertices)


@dataclass(frozen=True, eq=False)
class MeshAdjacency:
    """The edges and vertices of a mesh, edges first, and the corners of faces around them.

    Attributes:
        edges: (F, 3) the edge opposite to each corner.
        n_edges: how many edges there are; vertex i is feature n_edges + i.
        starts: (n_edges + N + 1,) where the corners of each feature begin.
        corners: (6 F,) corner k of face f as 3 f + k; of an edge, the corners opposite to it.
    """

    edges: Index
    n_edges: int
    starts: Index
    corners: Index

    @staticmethod
    def of(faces: Index, n_vertices: int) -> MeshAdjacency:
        """The features of a mesh of n_vertices."""
        ends = np.sort(faces[:, CORNERS], axis=2)
        keys = (ends[..., 0] * n_vertices + ends[..., 1]).ravel()
        unique, edges = np.unique(keys, return_inverse=True)
        of_corners = np.concatenate([edges.ravel(), len(unique) + faces.ravel()])
        counts = np.bincount(of_corners, minlength=len(unique) + n_vertices)
        corners = np.argsort(of_corners, kind="stable") % faces.size
        starts = np.concatenate([[0], np.cumsum(counts)])
        return MeshAdjacency(edges.reshape(faces.shape), len(unique), starts, corners)


ROWS = 18  # numbers of a triangle: corners a, b, c (9), 1 / |edge|^2 of ab, ac, bc (3), slopes (6)
FAR = 1e150  # m: where there are no triangles; its square is still finite
TINY = 1e-300  # m^2: the square of an edge that counts as a point
BOX_MARGIN = 1e-14  # of the largest coordinate: boxes are wider by so much, more than rounding is


@dataclass(frozen=True, eq=False)
class TreeBoxes:
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

    order: TriangleTree
    vertices: Array
    triangles: Array
    nodes: Array
    normals: Array
    areas: Array
    turns: Array

    @staticmethod
    def of(order: TriangleTree, vertices: Array) -> TreeBoxes:
        """The boxes around vertices (N, 3) m."""
        filled = order.leaves != NONE
        corners = np.where(filled, order.ends.T[:, order.leaves], 0)  # (3, L, WIDE)
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
            triangles[:, row] = np.where(filled, values, FAR if row < 9 else 0)
        low = np.where(filled, np.minimum(np.minimum(a, b), c), FAR).min(axis=2)
        high = np.where(filled, np.maximum(np.maximum(a, b), c), -FAR).max(axis=2)
        wide = widening(vertices)
        nodes = _nodes(order.levels, low - wide, high + wide)
        even = (order.rising[:, 1] - order.rising[:, 0]) % 3 == 1
        normals = _by_face(order, n) * np.where(even, 1.0, -1.0)[:, None]
        turns, rising = np.empty_like(normals), np.stack([dot(u, v), -dot(u, w), dot(v, w)])
        np.put_along_axis(turns, order.rising, _by_face(order, rising), axis=1)
        areas = _by_face(order, area[None])[:, 0]
        return TreeBoxes(order, vertices, triangles, nodes, normals, areas, turns)

    @cached_property
    def angles(self) -> Array:
        """The angle at every corner of every face, (F, 3); 0 where an edge has no length."""
        return np.asarray(np.arctan2(self.areas[:, None], self.turns))


def widening(vertices: Array) -> float:
    """By how much boxes are wider than what is in them, m."""
    return float(BOX_MARGIN * np.abs(vertices).max())


def _by_face(order: TriangleTree, values: Array) -> Array:
    """(k, L, WIDE) -> (F, k)."""
    return np.ascontiguousarray(values.reshape(len(values), -1)[:, order.lanes].T)


def _nodes(levels: tuple[int, ...], low: Array, high: Array) -> Array:
    """The boxes of the children of all nodes, from those of the leaves, (3, L) both."""
    boxes: list[Array] = []
    for count in reversed(levels[:-1]):
        missing = ((0, 0), (0, count * WIDE - low.shape[1]))
        low = np.pad(low, missing, constant_values=FAR).reshape(3, count, WIDE)
        high = np.pad(high, missing, constant_values=-FAR).reshape(3, count, WIDE)
        boxes.insert(0, np.concatenate([low, high]).transpose(1, 0, 2))
        low, high = low.min(axis=2), high.max(axis=2)
    return np.ascontiguousarray(np.concatenate(boxes))


def dot(x: Array | list[Array], y: Array | list[Array]) -> Array:
    """The products of vectors whose three coordinates come first."""
    return np.asarray(x[0] * y[0] + x[1] * y[1] + x[2] * y[2])


def _cross(x: Array, y: Array) -> Array:
    return np.stack(
        [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    )


POINTS_AT_ONCE = 2048  # points that descend together
MOST_PAIRS = 8192  # pairs of a point and a node that are looked at together
SHRINK = 1 - 1e-14  # of the distance to a box, so that rounding hides no triangle
# Which corners of a, b, c a candidate lies between: a, b, c, ab, ac, bc, and the inside.
BETWEEN = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]])


@dataclass(frozen=True, eq=False)
class Query:
    """What is searched for.

    Attributes:
        points: (M, 3) m.
        within: m, how far a triangle may be.
        normals: (M, 3) of the points, or None.
        facing: the least cosine of a triangle's normal with the point's.
    """

    points: Array
    within: float
    normals: Array | None
    facing: float


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Where the closest triangles are.

    Attributes:
        faces: (M,), NONE where there is none.
        shares: (M, 3) barycentric coordinates, for the face's corners in their own order.
        squares: (M,) m^2, the squared distance.
        normals: (M, 3) the sum of the normals around the place, of any length.
    """

    faces: Index
    shares: Array
    squares: Array
    normals: Array


@dataclass(frozen=True, eq=False)
class SearchBackend:
    """The two functions of a search, in NumPy or compiled.

    Attributes:
        boxes: makes the boxes, from the order of the triangles and the vertices (N, 3) m.
        search: finds what is asked for, in boxes that `boxes` has made.
    """

    boxes: Callable[[TriangleTree, Array], TreeBoxes]
    search: Callable[[TreeBoxes, Query], SearchResult]


def by_numpy(boxes: TreeBoxes, query: Query) -> SearchResult:
    """The closest triangle of each point, and the place in it."""
    M = len(query.points)
    search = _Search(boxes, query, np.full(M, query.within**2), np.full(M, len(boxes.order.faces)))
    for first in range(0, M, POINTS_AT_ONCE):
        search.run(np.arange(first, min(first + POINTS_AT_ONCE, M)))
    faces = np.where(search.faces < len(boxes.order.faces), search.faces, NONE)
    shares, normals, near = np.zeros((M, 3)), np.zeros((M, 3)), np.flatnonzero(faces != NONE)
    shares[near] = _shares(boxes, faces[near], query.points[near])
    normals[near] = _normals(boxes, faces[near], shares[near])
    return SearchResult(faces, shares, search.squares, normals)


@dataclass(frozen=True, eq=False)
class _Search:
    """The best found so far: squared distances (M,) and faces (M,), which change."""

    boxes: TreeBoxes
    query: Query
    squares: Array
    faces: Index

    def run(self, points: Index) -> None:
        """Find the closest triangles of these points.

        The nearest child of every node comes first, all others once that is done: most are then
        farther than what was found.
        """
        levels = self.boxes.order.levels
        offsets = np.cumsum((0, *levels))
        waiting = [(0, points, np.zeros_like(points), np.zeros(len(points)))]
        while waiting:
            level, points, nodes, squares = waiting.pop()
            near = squares <= self.squares[points]
            points, nodes = points[near], nodes[near]
            if len(points) > MOST_PAIRS:
                for part in range(0, len(points), MOST_PAIRS):
                    chosen = slice(part, part + MOST_PAIRS)
                    waiting.append((level, points[chosen], nodes[chosen], squares[near][chosen]))
                continue
            if not len(points):
                continue
            if level == len(levels) - 1:
                self._visit(points, nodes)
                continue
            lower = self._to_children(points, offsets[level] + nodes)
            first = np.argmin(lower, axis=1)
            rows = np.arange(len(points))
            nearest = lower[rows, first].copy()
            lower[rows, first] = np.inf
            row, child = np.nonzero((lower <= self.squares[points][:, None]) & (lower < FAR))
            rest = (points[row], WIDE * nodes[row] + child, lower[row, child])
            waiting.append((level + 1, *rest))
            waiting.append((level + 1, points, WIDE * nodes + first, nearest))

    def _to_children(self, points: Index, nodes: Index) -> Array:
        """Squared distances (n, WIDE) to the boxes of a node's children, rounded down."""
        sides, p = self.boxes.nodes[nodes], self.query.points[points]
        outside = [
            np.maximum(np.maximum(sides[:, k] - p[:, k, None], p[:, k, None] - sides[:, k + 3]), 0)
            for k in range(3)
        ]
        return np.asarray(dot(outside, outside) * SHRINK)

    def _visit(self, points: Index, leaves: Index) -> None:
        """Compare the triangles of leaves with the best so far."""
        p = self.query.points[points]
        rows = self.boxes.triangles[leaves].transpose(1, 0, 2)
        squares = np.minimum.reduce(_candidates(rows, p.T[:, :, None])[0])
        numbers = self.boxes.order.leaves[leaves]
        counts: Mask = numbers != NONE
        if self.query.normals is not None:
            n, q = self.boxes.normals[numbers], self.query.normals[points][:, None]
            counts &= dot(np.moveaxis(n, -1, 0), np.moveaxis(q, -1, 0)) >= self.query.facing
        row, lane = np.nonzero(counts & (squares <= self.squares[points][:, None]))
        squares, numbers, points = squares[row, lane], numbers[row, lane], points[row]
        order = np.lexsort((numbers, squares, points))
        squares, numbers, points = squares[order], numbers[order], points[order]
        first = np.diff(points, prepend=-1) > 0
        squares, numbers, points = squares[first], numbers[first], points[first]
        better = (squares < self.squares[points]) | (numbers < self.faces[points])
        self.squares[points[better]] = squares[better]
        self.faces[points[better]] = numbers[better]


def _candidates(rows: Array, p: Array) -> tuple[list[Array], list[Array]]:
    """Squared distances from p to seven places in triangles, infinite where there is no such place.

    In the order of BETWEEN; then v, w and the shares along ab, ac and bc.
    """
    corners, inverses, slopes = rows[:9].reshape(3, 3, *rows.shape[1:]), rows[9:12], rows[12:]
    a, b, c = corners
    ap, bp, cp = p - a, p - b, p - c
    squares, places = [dot(ap, ap), dot(bp, bp), dot(cp, cp)], []
    for start, edge, inverse in zip((ap, ap, bp), (b - a, c - a, c - b), inverses, strict=True):
        t = dot(start, edge) * inverse
        away = start - t * edge
        squares.append(np.where((t > 0) & (t < 1), dot(away, away), np.inf))
        places.append(t)
    v, w, away = np.zeros_like(t), np.zeros_like(t), ap
    for _ in range(2):  # a second time, as the first is inexact in a thin triangle
        more_v, more_w = dot(away, slopes[:3]), dot(away, slopes[3:])
        v, w = v + more_v, w + more_w
        away = (away - more_v * (b - a)) - more_w * (c - a)
    squares.append(np.where((v > 0) & (w > 0) & ((1 - v) - w > 0), dot(away, away), np.inf))
    return squares, [v, w, *places]


def _shares(boxes: TreeBoxes, faces: Index, points: Array) -> Array:
    """Barycentric coordinates (n, 3) of the places in these faces that are closest to points."""
    leaf, lane = np.divmod(boxes.order.lanes[faces], WIDE)
    squares, (v, w, ab, ac, bc) = _candidates(boxes.triangles[leaf, :, lane].T, points.T)
    kind = np.argmin(np.stack(squares), axis=0)
    none, all_ = np.zeros_like(v), np.ones_like(v)
    a = np.choose(kind, [all_, none, none, 1 - ab, 1 - ac, none, (1 - v) - w])
    b = np.choose(kind, [none, all_, none, ab, none, 1 - bc, v])
    c = np.choose(kind, [none, none, all_, none, ac, bc, w])
    shares = np.empty((len(faces), 3))
    np.put_along_axis(shares, boxes.order.rising[faces], np.stack([a, b, c], axis=1), axis=1)
    return shares


def _normals(boxes: TreeBoxes, faces: Index, shares: Array) -> Array:
    """The sum of the normals of all faces that meet at places in these faces, (n, 3)."""
    features, normals = boxes.order.features, boxes.normals[faces]
    corners = (shares > 0).sum(axis=1)
    for kind in (1, 2):  # at a vertex, on an edge
        chosen = np.flatnonzero(corners == kind)
        pick = np.argmax if kind == 1 else np.argmin
        corner = pick(shares[chosen], axis=1)
        table = features.n_edges + boxes.order.faces if kind == 1 else features.edges
        feature = table[faces[chosen], corner]
        first, counts = features.starts[feature], np.diff(features.starts)[feature]
        rows = np.repeat(np.arange(len(chosen)), counts)
        within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
        around = features.corners[first[rows] + within]
        n = boxes.normals[around // 3]
        if kind == 1:
            n = n * boxes.angles.ravel()[around][:, None]
        for axis in range(3):
            normals[chosen, axis] = np.bincount(rows, n[:, axis], minlength=len(chosen))
    return normals


IN_NUMPY = SearchBackend(TreeBoxes.of, by_numpy)
