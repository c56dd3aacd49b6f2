"""The triangles of a mesh in the order of a tree: neighbours in space are neighbours in memory.

The tree halves the triangles again and again, across the longest side of their centroids' box,
until at most WIDE are left in each leaf; three halvings make one step, so that a node has WIDE
children. All leaves are on one level, so that where a node's children are needs no pointers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import Array, Index

WIDE = 8  # triangles in a leaf, children of a node
NONE = -1  # in place of a face
CORNERS = ((1, 2), (2, 0), (0, 1))  # of a triangle's edges: edge k is opposite to corner k


@dataclass(frozen=True, eq=False)
class Order:
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
    def of(vertices: Array, faces: Index) -> Order:
        """The order in which a mesh is split where its vertices are now."""
        F = len(faces)
        halvings = max(0, (-(-F // WIDE) - 1).bit_length())
        each = -(-F // 2**halvings)
        middles = np.full((2**halvings * each, 3), np.inf)
        middles[:F] = vertices[faces].mean(axis=1)
        order = np.arange(len(middles))[None]
        for _ in range(halvings):
            here = middles[order]
            low, high = here.min(axis=1), np.where(np.isfinite(here), here, -np.inf).max(axis=1)
            with np.errstate(invalid="ignore"):  # a group of no triangles
                axis = np.argmax(high - low, axis=1)
            along = np.take_along_axis(here, axis[:, None, None], axis=2)[..., 0]
            half = order.shape[1] // 2
            split = np.argpartition(along, half, axis=1)
            order = np.take_along_axis(order, split, axis=1).reshape(-1, half)
        order = np.sort(order, axis=1)
        leaves = np.full((len(order), WIDE), NONE)
        leaves[:, :each] = np.where(order < F, order, NONE)
        return Order(faces, len(vertices), leaves)

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
        where, there = np.empty(len(self.faces), np.int64), self.leaves.ravel() != NONE
        where[self.leaves.ravel()[there]] = np.flatnonzero(there)
        return where

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
    def features(self) -> Features:
        """What the faces share."""
        return Features.of(self.faces, self.n_vertices)


@dataclass(frozen=True, eq=False)
class Features:
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
    def of(faces: Index, n_vertices: int) -> Features:
        """The features of a mesh of n_vertices."""
        ends = np.sort(faces[:, CORNERS], axis=2)
        keys = (ends[..., 0] * n_vertices + ends[..., 1]).ravel()
        unique, edges = np.unique(keys, return_inverse=True)
        of_corners = np.concatenate([edges.ravel(), len(unique) + faces.ravel()])
        counts = np.bincount(of_corners, minlength=len(unique) + n_vertices)
        corners = np.argsort(of_corners, kind="stable") % faces.size
        starts = np.concatenate([[0], np.cumsum(counts)])
        return Features(edges.reshape(faces.shape), len(unique), starts, corners)
