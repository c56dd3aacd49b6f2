"""The three resolutions: which mesh, and how its vertices follow the base mesh."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.geometry.mirror import REFLECTION
from workbench.geometry.surface_tree import barycentric_weights, nearest
from workbench.synthetic.base_mesh import N_BODY, BaseMesh
from workbench.synthetic.wheel import ObjMesh, Wheel, WheelUnreadable

FILES = {
    "default": "topology/notoes_collapse10pc.obj",
    "small": "topology/notoes_collapse3pc.obj",
    "full": "topology/notoes.obj",
}


@dataclass(frozen=True, eq=False)
class Topology:
    """N vertices, each a weighted mean of base vertices, and the triangles between them.

    Attributes:
        follows: (N, 13380), the weights of base vertices, in rows that sum to one.
        faces: (F, 3), facing outwards, symmetric.
        mirror: (N,), for each vertex the one on the other side.
    """

    follows: csr_array
    faces: Index
    mirror: Index

    def vertices(self, people: Array) -> Array:
        """The vertices (P, N, 3) m of people given on the base mesh, (P, 13380, 3) m."""
        return np.stack([self.follows @ person for person in people])


def read_topology(wheel: Wheel, name: str, base: BaseMesh) -> Topology:
    """The topology of one of the embedded bodies."""
    mesh = wheel.mesh(FILES[name])
    distances, mirror = nearest(mesh.vertices, mesh.vertices * REFLECTION)
    if distances.max() > 1e-6 or not np.array_equal(mirror[mirror], np.arange(len(mirror))):
        raise WheelUnreadable(f"{FILES[name]} is not alike on both sides")
    follows = barycentric_weights(base.vertices[:N_BODY], base.triangles, mesh.vertices)
    other_side = follows[mirror][:, base.mirror[:N_BODY]]
    return Topology(csr_array((follows + other_side) / 2), _triangulated(mesh, mirror), mirror)


def _triangulated(mesh: ObjMesh, mirror: Index) -> Index:
    """Quads halved along the shorter diagonal, the same one on both sides."""
    halves: dict[frozenset[int], list[tuple[int, ...]]] = {}
    triangles: list[tuple[int, ...]] = []
    for polygon in mesh.polygons:
        reflected = [int(mirror[v]) for v in polygon]
        known = halves.get(frozenset(reflected))
        mine: list[tuple[int, ...]] = (
            [(int(mirror[a]), int(mirror[c]), int(mirror[b])) for a, b, c in known]
            if known
            else _halves(polygon, mesh.vertices)
        )
        halves[frozenset(polygon)] = mine
        triangles += mine
    return np.array(triangles)


def _halves(polygon: tuple[int, ...], vertices: Array) -> list[tuple[int, ...]]:
    if len(polygon) == 3:
        return [polygon]
    a, b, c, d = polygon
    if np.linalg.norm(vertices[a] - vertices[c]) <= np.linalg.norm(vertices[b] - vertices[d]):
        return [(a, b, c), (a, c, d)]
    return [(a, b, d), (b, c, d)]
