"""How deep one surface is within a solid: the place of the surface that is deepest, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index, Mask
from workbench.geometry.surface_tree import Closest, SurfaceTree
from workbench.geometry.winding import winding_numbers

TOGETHER = 2_000  # triangles that are looked at in one round
INSIDE = 0.5  # winding number


@dataclass(frozen=True, eq=False)
class Patch:
    """A piece of a surface, such as the skin of a hand, and what closes it to a solid.

    Attributes:
        skin: (F, 3) its triangles, by the numbers of the whole surface's vertices.
        rims: for each opening, the edges (E, 2) around it.
    """

    skin: Index
    rims: tuple[Index, ...]

    @staticmethod
    def of(skin: Index) -> Patch:
        """The patch of triangles (F, 3) of an oriented surface."""
        F = len(skin)
        corners = np.arange(3 * F).reshape(F, 3)
        halves, at = (x[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2) for x in (skin, corners))
        one, other = _opposite(halves)
        alone = np.setdiff1d(np.arange(len(halves)), one)
        # corners in one vertex are one point of the rim only if edges join their triangles there
        joined = np.column_stack([at[one].ravel(), at[other][:, ::-1].ravel()])
        joined = np.concatenate([joined, at[alone]])  # and edges of one opening follow each other
        opening = _components(joined, 3 * F)[at[alone, 0]]
        return Patch(skin, tuple(halves[alone[opening == k]] for k in np.unique(opening)))

    def solid(self, vertices: Array) -> Solid:
        """The patch with vertices (N, 3) m, each opening closed by a cone from its rim's mean."""
        places, faces = vertices, [self.skin]
        for rim in self.rims:
            middle = np.full(len(rim), len(places))
            places = np.vstack([places, vertices[rim[:, 0]].mean(axis=0)])
            faces.append(np.column_stack([rim[:, ::-1], middle]))
        return Solid(places, self.skin, np.vstack(faces))


@dataclass(frozen=True, eq=False)
class Solid:
    """What a patch encloses once its openings are closed.

    Attributes:
        vertices: (N', 3) m, with those that close openings.
        skin: (F, 3) the triangles of the patch.
        faces: (F', 3) these, and those that close openings.
    """

    vertices: Array
    skin: Index
    faces: Index

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The lowest and the highest x, y, z (3,) m."""
        corners = self.vertices[self.skin.ravel()]
        return corners.min(axis=0), corners.max(axis=0)

    def holds(self, points: Array) -> Mask:
        """Which of points (M, 3) m are inside: their winding number is above one half."""
        low, high = self.box
        found = np.asarray(((points >= low) & (points <= high)).all(axis=1))
        found[found] = winding_numbers(points[found], self.vertices, self.faces) > INSIDE
        return found

    def from_skin(self, points: Array) -> Closest:
        """The places of the skin that are closest to points (M, 3) m."""
        return self._skin.closest(points)

    def near_border(self, points: Array, reach: Array) -> Mask:
        """Which points are no farther than `reach` (M,) m from the border, openings included."""
        return np.asarray(abs(self._border.closest(points).distances) <= reach)

    @cached_property
    def _skin(self) -> SurfaceTree:
        return SurfaceTree(self.vertices, self.skin)

    @cached_property
    def _border(self) -> SurfaceTree:
        return SurfaceTree(self.vertices, self.faces)


@dataclass(frozen=True, eq=False)
class Deepest:
    """The place of a surface that is deepest within a solid.

    Attributes:
        depth: m from the skin of the solid; 0 if no place is inside.
        place: (3,) m; NaN if no place is inside.
        face: the triangle of the solid's skin that is closest to the place; -1 if there is none.
    """

    depth: float
    place: Array
    face: int


def deepest(triangles: Array, within: Solid, tolerance: float = 5e-4) -> Deepest:
    """Where triangles (F, 3 corners, 3) m are deepest within a solid.

    The depth of a place inside is its distance from the skin of the solid. It is right to
    `tolerance` m, if not only a spot smaller than this is deeper: triangles are divided into four,
    the most promising first, until none can hold a place that is deeper by more. No place of a
    triangle is deeper than its middle by more than their distance, and none is farther from the
    skin than a corner is from any one place of it.
    """
    low, high = within.box
    near = ((triangles.max(axis=1) >= low) & (triangles.min(axis=1) <= high)).all(axis=1)
    triangles = triangles[near]
    limits = np.full(len(triangles), np.inf)  # no place of the triangle is deeper
    best = Deepest(0.0, np.full(3, np.nan), -1)
    while len(triangles):
        first = np.argsort(-limits, kind="stable")
        now, later = first[:TOGETHER], first[TOGETHER:]
        looked, waiting = triangles[now], (triangles[later], limits[later])
        middles = looked.mean(axis=1)
        reach = np.linalg.norm(looked - middles[:, None], axis=2).max(axis=1)
        skin = within.from_skin(middles)
        distances = abs(skin.distances)
        farthest = np.linalg.norm(looked - skin.points[:, None], axis=2).max(axis=1)
        inside = within.holds(middles)
        k = int(np.argmax(np.where(inside, distances, -1.0)))
        if inside[k] and distances[k] > best.depth:
            best = Deepest(float(distances[k]), middles[k], int(skin.faces[k]))
        own = np.minimum(np.minimum(distances + reach, farthest), limits[now])
        open_ = (own > best.depth + tolerance) & (reach > tolerance / 2)
        open_[open_] = inside[open_] | within.near_border(middles[open_], reach[open_])
        triangles = np.concatenate([_quartered(looked[open_]), waiting[0]])
        limits = np.concatenate([np.tile(own[open_], 4), waiting[1]])
        promising = limits > best.depth + tolerance
        triangles, limits = triangles[promising], limits[promising]
    return best


def _opposite(halves: Index) -> tuple[Index, Index]:
    """Which of the directed edges (E, 2) run opposite to which, (n,) and (n,)."""
    n = int(halves.max(initial=0)) + 1
    key, wanted = halves[:, 0] * n + halves[:, 1], halves[:, 1] * n + halves[:, 0]
    order = np.argsort(key, kind="stable")
    place = np.minimum(np.searchsorted(key, wanted, sorter=order), len(order) - 1)
    other = order[place]
    one = np.flatnonzero(key[other] == wanted)
    return one, other[one]


def _components(pairs: Index, n: int) -> Index:
    """The number of the connected component of each of n things that pairs (P, 2) join."""
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _quartered(triangles: Array) -> Array:
    """Each triangle (F, 3 corners, 3) as four, (4 F, 3, 3)."""
    a, b, c = triangles.transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(corners, axis=1) for corners in four])
