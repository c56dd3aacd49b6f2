"""The mesh of a body whose hands give way to hands of other triangles on the same vertices."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index, Mask
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadBody
from workbench.geometry.surface_tree import barycentric_weights


@dataclass(frozen=True, eq=False)
class Sewing:
    """Where the right hand is on a body that is alike on both sides.

    Attributes:
        vertices: (H,) the vertex of the body that each vertex of the hand is.
        held: (16, 3) rad, the pose of the hand in which the body at rest holds its fingers.
    """

    vertices: Index
    held: Array


@dataclass(frozen=True, eq=False)
class SewnMesh:
    """N of the vertices of a body, and triangles between them.

    Attributes:
        origin: (N,) the number that each vertex has in the body.
        faces: (F, 3).
        mirror: (N,) the vertex on the other side of each.
        hands: by side, the vertex (H,) that each vertex of the hand is.
    """

    origin: Index
    faces: Index
    mirror: Index
    hands: Mapping[str, Index]

    def of_hand(self, side: str, rows: csr_array) -> csr_array:
        """Means of the vertices of a hand (M, H) as means of these, (M, N)."""
        found = rows.tocoo()
        columns, shape = self.hands[side][found.col], (rows.shape[0], len(self.origin))
        return csr_array((found.data, (found.row, columns)), shape=shape)

    def of_body(self, rows: csr_array, template: Array) -> csr_array:
        """Means of the vertices of the body (M, N_body), `template` (N_body, 3) m, as of these.

        The closest place on the surface stands for a vertex that is no longer there.
        """
        N, before = len(self.origin), len(template)
        now = csr_array((np.ones(N), (self.origin, np.arange(N))), shape=(before, N))
        gone = np.setdiff1d(rows.tocoo().col, self.origin)
        if len(gone):
            place = barycentric_weights(template[self.origin], self.faces, template[gone]).tocoo()
            shares = csr_array((place.data, (gone[place.row], place.col)), shape=(before, N))
            now = now + shares
        return csr_array(rows @ now)


def border(faces: Index, count: int) -> Mask:
    """Which of `count` vertices are on the border of a surface that is open."""
    ends = np.sort(_edges(faces))
    edges, times = np.unique(ends, axis=0, return_counts=True)
    found = np.zeros(count, dtype=bool)
    found[edges[times == 1]] = True
    return found


def sewn_mesh(body: SkinnedBody, faces: Index, right: Index) -> SewnMesh:
    """The body's mesh, cut along the border of the right hand and its mirror image.

    `faces` (F, 3) are the triangles of the hand, `right` (H,) the body's vertices that are its own.
    Raises BadBody for a body that does not know its other side.
    """
    if body.mirror is None:
        raise BadBody(f"body {body.name!r} has no mirror, which hands on both sides need")
    on_border = border(faces, len(right))
    inner = right[~on_border]
    beyond = _cut_off(body, right[on_border], inner[0])
    gone = beyond | beyond[body.mirror]
    origin = np.concatenate([np.flatnonzero(~gone), inner, body.mirror[inner]])
    place = np.full(body.n_vertices, -1)
    place[origin] = np.arange(len(origin))
    hands = {"left": place[body.mirror[right]], "right": place[right]}
    own = place[body.faces[~gone[body.faces].any(axis=1)]]
    turned = faces[:, [0, 2, 1]]  # in the mirror, so that they face outwards
    triangles = np.concatenate([own, hands["right"][faces], hands["left"][turned]])
    return SewnMesh(origin, triangles, place[body.mirror[origin]], hands)


def _cut_off(body: SkinnedBody, loop: Index, inside: int) -> Mask:
    """The vertices (N,) on that side of a loop of edges on which the vertex `inside` is."""
    ends = _edges(body.faces)
    ends = ends[~np.isin(ends, loop).any(axis=1)]
    N = body.n_vertices
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(N, N))
    _, part = connected_components(graph, directed=False)
    found: Mask = part == part[inside]
    return found


def _edges(faces: Index) -> Index:
    return np.concatenate([np.roll(faces, k, axis=1)[:, :2] for k in range(3)])
