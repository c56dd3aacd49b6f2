"""The volume, the radius and the edges of a limb that bends or twists.

Each is a number for every angle, of any skinned body and joint, so that skinning methods can be
compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument, UnknownName
from workbench.geometry.solids import lengths, mesh_edges, volume

CARRIED = 0.5  # the least weight of a vertex for the two bones of a joint together
HALFWAY = 0.2  # how far from one half weights may be at the thinnest place of a limb


@dataclass(frozen=True, eq=False)
class Limb:
    """The two bones that meet at a joint, and the skin that follows them.

    Raises UnknownName for a joint that is not there, BadArgument for the root.
    """

    body: SkinnedBody
    joint: str

    def __post_init__(self) -> None:
        if self.joint not in self.body.joint_names:
            raise UnknownName("joint", self.joint, self.body.joint_names)
        if self.index == 0:
            raise BadArgument(f"{self.joint} is the root: no bone of the body leads to it")

    @property
    def index(self) -> int:
        """The joint's number."""
        return self.body.joint_names.index(self.joint)

    @property
    def parent(self) -> int:
        """The joint at the other end of the bone that leads here."""
        return self.body.parents[self.index]

    @cached_property
    def bone(self) -> Array:
        """The direction of that bone at rest, (3,), of length one."""
        rest = self.body.joints()
        along = rest[self.index] - rest[self.parent]
        return np.asarray(along / np.linalg.norm(along))

    @cached_property
    def faces(self) -> Index:
        """The skin of the two bones in one piece, (F, 3)."""
        weights = self.body.weights
        carried = weights[:, self.index] + weights[:, self.parent] > CARRIED
        chosen = self.body.faces[carried[self.body.faces].all(axis=1)]
        N = self.body.n_vertices
        pairs = mesh_edges(chosen)
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(N, N))
        _, label = connected_components(graph, directed=False)
        sizes = np.bincount(label[chosen[:, 0]])
        return np.asarray(chosen[label[chosen[:, 0]] == sizes.argmax()])

    @cached_property
    def turning(self) -> Array:
        """The weight of each vertex at the joint and at all joints below it, (N,)."""
        beyond = np.arange(self.body.n_joints) == self.index
        for k in range(self.index + 1, self.body.n_joints):
            beyond[k] = beyond[self.body.parents[k]]
        return np.asarray(self.body.weights[:, beyond].sum(axis=1))

    @cached_property
    def waist(self) -> Index:
        """The vertices that follow the turning and the resting bones about equally."""
        found = np.flatnonzero(np.abs(self.turning - 0.5) <= HALFWAY)
        if not len(found):
            raise BadArgument(
                f"body {self.body.name!r} has no vertex between {self.joint} and "
                f"{self.body.joint_names[self.parent]} that follows both about equally"
            )
        return found

    def posed(self, axis: ArrayLike, angles: Sequence[float] | Array) -> Array:
        """The body (A, N, 3) m with this joint alone turned about `axis` (3,) by `angles` rad."""
        pose = np.tile(self.body.bind_pose, (len(angles), 1, 1))
        unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
        pose[:, self.index] = np.asarray(angles)[:, None] * unit
        return self.body.vertices(pose)

    def volumes(self, axis: ArrayLike, angles: Sequence[float] | Array) -> Array:
        """The volume inside of the skin of the two bones, m^3, by angle (A,) about `axis`."""
        posed = self.posed(axis, angles)
        return np.asarray([piece_volume(vertices, self.faces) for vertices in posed])

    def radii(self, angles: Sequence[float] | Array) -> Array:
        """The radius of the twisted limb at its waist as a share of that at rest, (A,).

        It is the mean distance of the waist from the line of the bone, which a twist leaves in
        place.
        """
        centre = self.body.joints()[self.index]
        reach = [
            _distances(vertices[self.waist] - centre, self.bone).mean()
            for vertices in (self.body.template, *self.posed(self.bone, angles))
        ]
        return np.asarray(np.array(reach[1:]) / reach[0])

    def stretches(self, axis: ArrayLike, angles: Sequence[float] | Array) -> tuple[Array, Array]:
        """The least and the largest ratio of an edge's length to its length at rest, (A,) each."""
        pairs = mesh_edges(self.faces)
        rest = lengths(self.body.template, pairs)
        ratios = np.array([lengths(v, pairs) / rest for v in self.posed(axis, angles)])
        return ratios.min(axis=1), ratios.max(axis=1)


def _distances(points: Array, direction: Array) -> Array:
    """The distances (n,) of points from a line through the origin."""
    across = points - (points @ direction)[:, None] * direction
    return np.asarray(np.linalg.norm(across, axis=1))


def lids(triangles: Index) -> list[Index]:
    """The open ends of a piece of surface: each the directed edges (n, 2) that close it."""
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    known = {(int(a), int(b)) for a, b in directed}
    open_edges = np.array([(b, a) for a, b in sorted(known) if (b, a) not in known], dtype=np.int64)
    if not len(open_edges):
        return []
    n = int(open_edges.max()) + 1
    graph = coo_array((np.ones(len(open_edges)), tuple(open_edges.T)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    ends = label[open_edges[:, 0]]
    return [open_edges[ends == end] for end in np.unique(ends)]


def piece_volume(vertices: Array, triangles: Index) -> float:
    """Inside a piece of surface whose open ends are closed by cones from their mean points, m^3."""
    points, faces = [vertices], [triangles]
    for number, lid in enumerate(lids(triangles)):
        points.append(vertices[np.unique(lid)].mean(axis=0, keepdims=True))
        top = np.full((len(lid), 1), len(vertices) + number)
        faces.append(np.hstack([lid, top]))
    return volume(np.vstack(points), np.vstack(faces))
