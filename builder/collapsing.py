"""A coarser mesh of some of the same vertices: short edges collapse, on both sides alike."""

from dataclasses import replace
from heapq import heappop, heappush

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import Topology
from workbench.arrays import Array, Index, Mask
from workbench.errors import BadArgument
from workbench.geometry.solids import mesh_edges

UPRIGHT = 0.2  # cosine: a triangle that turns farther is not allowed


def collapsed(topology: Topology, template: Array, count: int) -> Topology:
    """The topology with `count` of its vertices, as evenly spread over the mesh as possible.

    `template` (N, 3) m is the mesh. The shortest edge collapses first, one end into the other,
    together with its mirror image. A closed surface stays closed: only edges collapse whose ends
    have two neighbours in common, and no triangle turns over. Vertices on the midline and beside it
    stay. Raises BadArgument if these are more than `count`, or if the mesh has fewer vertices than
    `count`.
    """
    if not 0 < count <= len(template):
        raise BadArgument(
            f"the mesh has {len(template)} vertices; ask for 1 to so many, not {count}"
        )
    mesh = _Mesh(template, topology.faces)
    mirror, left = topology.mirror, template[:, 0] > 0
    inside = left & (mirror != np.arange(len(mirror)))
    _collapse_short_edges(mesh, inside, count, mirror)
    kept, faces = mesh.kept()
    place = np.full(len(template), -1)
    place[kept] = np.arange(len(kept))
    follows = csr_array(topology.follows[kept])
    return replace(topology, follows=follows, faces=faces, mirror=place[mirror[kept]])


def collapsed_part(
    template: Array, triangles: Index, fixed: Index, count: int
) -> tuple[Index, Index]:
    """The `count` vertices (n,) that are left of a mesh, and its triangles (F, 3) by their places.

    `template` (N, 3) m is the mesh, which may have a border; the vertices in `fixed` stay, and
    everything else is as in `collapsed`, without a mirror image. Raises BadArgument if the mesh
    does not come down to `count`.
    """
    mesh, inside = _Mesh(template, triangles), np.ones(len(template), dtype=bool)
    inside[fixed] = False
    _collapse_short_edges(mesh, inside, count)
    return mesh.kept()


def _collapse_short_edges(
    mesh: "_Mesh", inside: Mask, count: int, mirror: Index | None = None
) -> None:
    """Collapse edges whose first end is `inside`, the shortest first, down to `count` vertices.

    With a `mirror` (N,), each together with its image, if all neighbours are inside as well.
    """
    waiting: list[tuple[float, int, int]] = []

    def wait(a: int, b: int) -> None:
        length = float(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]))
        for v, u in ((a, b), (b, a)):
            if inside[v]:
                heappush(waiting, (length, v, u))

    for a, b in mesh.edges:
        wait(a, b)
    remaining, step = len(mesh.vertices), 1 if mirror is None else 2
    while remaining > count:
        if not waiting or remaining - step < count:
            raise BadArgument(
                f"a mesh of {len(mesh.vertices)} vertices does not come down to {count}, as its "
                f"border and its midline stay; {remaining} was the last that it did"
            )
        _, v, u = heappop(waiting)
        if not (mesh.around[v] and u in mesh.neighbours(v) and mesh.may_go(v, u)):
            continue
        if mirror is not None:
            if not all(inside[n] for n in mesh.neighbours(v)):
                continue
            mesh.go(int(mirror[v]), int(mirror[u]))
        mesh.go(v, u)
        remaining -= step
        for n in sorted(mesh.neighbours(u)):
            wait(u, n)


class _Mesh:
    """Triangles while edges collapse."""

    def __init__(self, vertices: Array, faces: Index) -> None:
        self.vertices, self.edges = vertices, mesh_edges(faces).tolist()
        self.faces: list[tuple[int, ...] | None] = [tuple(face) for face in faces.tolist()]
        self.around: list[set[int]] = [set() for _ in vertices]
        for f, face in enumerate(faces.tolist()):
            for v in face:
                self.around[v].add(f)

    def kept(self) -> tuple[Index, Index]:
        """The vertices that are left, and the triangles by the places of these."""
        kept = np.flatnonzero([bool(faces) for faces in self.around])
        place = np.full(len(self.vertices), -1)
        place[kept] = np.arange(len(kept))
        return kept, place[[face for face in self.faces if face is not None]]

    def neighbours(self, v: int) -> set[int]:
        return {n for f in self.around[v] for n in self._corners(f)} - {v}

    def may_go(self, v: int, u: int) -> bool:
        """Whether v may move to u and vanish there."""
        if len(self.neighbours(v) & self.neighbours(u)) != 2:
            return False
        for f in self.around[v] - self.around[u]:
            before = self._corners(f)
            was, now = (self._normal(c) for c in (before, _moved(before, v, u)))
            if was @ now < UPRIGHT * np.linalg.norm(was) * np.linalg.norm(now) or not now.any():
                return False
        return True

    def go(self, v: int, u: int) -> None:
        """Triangles of both vanish; the others of v become u's."""
        for f in sorted(self.around[v]):
            corners = self._corners(f)
            if u in corners:
                for n in corners:
                    self.around[n].discard(f)
                self.faces[f] = None
            else:
                self.faces[f] = _moved(corners, v, u)
                self.around[u].add(f)
        self.around[v] = set()

    def _corners(self, f: int) -> tuple[int, ...]:
        face = self.faces[f]
        assert face is not None  # what is in `around` is there
        return face

    def _normal(self, corners: tuple[int, ...]) -> Array:
        a, b, c = self.vertices[list(corners)]
        return np.cross(b - a, c - a)


def _moved(corners: tuple[int, ...], v: int, u: int) -> tuple[int, ...]:
    return tuple(u if c == v else c for c in corners)
