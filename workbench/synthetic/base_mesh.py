"""The base mesh of MakeHuman: 19,158 vertices, of which the first 13,380 are the body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Index
from workbench.synthetic.wheel import Wheel

N_BODY = 13380  # the rest are helpers: eyes, clothes, and cubes that mark the joints
NIPPLES = (range(1778, 1794), range(8450, 8466))
SMOOTHED_RINGS = 3  # rings of vertices around a nipple that are smoothed with it: about 2 cm


@dataclass(frozen=True, eq=False)
class BaseMesh:
    """The base mesh, y up, facing +z, its left towards +x.

    Attributes:
        vertices: (19158, 3) in metres.
        quads: (13378, 4), of the body.
        groups: by name (`body`, `joint-pelvis`, `joint-l-knee`, ...) the numbers of its vertices.
        mirror: (19158,), the vertex on the other side of each.
    """

    vertices: Array
    quads: Index
    groups: dict[str, list[int]]
    mirror: Index

    @cached_property
    def triangles(self) -> Index:
        """The body's quads halved, (26756, 3)."""
        a, b, c, d = self.quads.T
        return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])

    def symmetrised(self, points: Array) -> Array:
        """Points (..., 19158, 3) m, or of the body only, made alike on both sides."""
        mirror = self.mirror[: points.shape[-2]]
        reflected: Array = points[..., mirror, :] * [-1.0, 1.0, 1.0]
        return (points + reflected) / 2

    @cached_property
    def smoothing(self) -> tuple[Index, Index, Array]:
        """Vertices to smooth (f,), vertices that they follow (b,), and the matrix (f, b)."""
        neighbours = self._neighbours
        inner: set[int] = set().union(*NIPPLES)
        for _ in range(SMOOTHED_RINGS):
            inner |= {n for v in inner for n in neighbours[v]}
        rim: set[int] = set()
        for _ in range(2):
            rim |= {n for v in inner | rim for n in neighbours[v]} - inner
        return self._membrane(sorted(inner), sorted(rim))

    def without_nipples(self, points: Array) -> Array:
        """Points (..., V, 3) m with the chest filled in smoothly, by one matrix for all."""
        inner, rim, matrix = self.smoothing
        smooth = points.copy()
        smooth[..., inner, :] = matrix @ points[..., rim, :]
        return smooth

    @cached_property
    def _neighbours(self) -> dict[int, set[int]]:
        neighbours: dict[int, set[int]] = {}
        for quad in self.quads.tolist():
            for here, there in zip(quad, quad[1:] + quad[:1], strict=True):
                neighbours.setdefault(here, set()).add(there)
                neighbours.setdefault(there, set()).add(here)
        return neighbours

    def _membrane(self, inner: list[int], rim: list[int]) -> tuple[Index, Index, Array]:
        """The thin plate through two rings of fixed vertices, with weights 1 / edge length."""
        vertices = [*inner, *rim]
        place = {v: i for i, v in enumerate(vertices)}
        laplacian = np.zeros((len(vertices), len(vertices)))
        for v in vertices:
            for n in self._neighbours[v] & place.keys():
                laplacian[place[v], place[n]] = -1 / np.linalg.norm(
                    self.vertices[v] - self.vertices[n]
                )
        np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
        free = len(inner)
        # |L x|^2 over the smoothed vertices and the inner rim: the outer rim lacks neighbours.
        complete = np.array([self._neighbours[v] <= place.keys() for v in vertices])
        rows = laplacian[complete]
        matrix: Array = scipy.linalg.lstsq(rows[:, :free], -rows[:, free:])[0]
        return np.array(inner), np.array(rim), matrix


def read_base_mesh(wheel: Wheel) -> BaseMesh:
    """The base mesh of the wheel."""
    mesh = wheel.mesh("mpfb2/3dobjs/base.obj")
    groups: dict[str, set[int]] = {}
    for polygon, group in zip(mesh.polygons, mesh.groups, strict=True):
        groups.setdefault(group, set()).update(polygon)
    pairs = zip(mesh.polygons, mesh.groups, strict=True)
    rows = wheel.read("mpfb2/mesh_metadata/hm08.mirror").decode().split("\n")
    return BaseMesh(
        vertices=0.1 * mesh.vertices,  # decimetres in the file
        quads=np.array([polygon for polygon, group in pairs if group == "body"]),
        groups={name: sorted(members) for name, members in groups.items()},
        mirror=np.array([int(row.split()[1]) for row in rows if row.strip()]),
    )
