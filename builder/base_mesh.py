"""MakeHuman's base mesh, its three resolutions, and its rig gathered into the 24 joints of SMPL."""

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse import csr_array

from builder.wheel import ObjMesh, Wheel, WheelUnreadable
from lectures.material.teacher import JOINT, JOINT_NAMES, N_FINE, N_JOINTS, coarse
from workbench.arrays import Array, Index
from workbench.geometry.mirror import REFLECTION
from workbench.geometry.surface_tree import barycentric_weights, nearest

N_BODY = 13380  # the rest are helpers: eyes, clothes, and cubes that mark the joints
NIPPLES = (range(1778, 1794), range(8450, 8466))
SMOOTHED_RINGS = 3  # rings of vertices around a nipple that are smoothed with it: about 2 cm
FILES = {
    "default": "topology/notoes_collapse10pc.obj",
    "small": "topology/notoes_collapse3pc.obj",
    "full": "topology/notoes.obj",
}
# Bones by the joint that carries them; the first pattern that matches a bone's name decides.
CARRIED = (
    (r"root|pelvis|spine0[45]", "pelvis"),
    (r"spine03", "spine1"),
    (r"spine02|breast", "spine2"),
    (r"spine01", "spine3"),
    (r"upperleg", "hip"),
    (r"lowerleg", "knee"),
    (r"foot", "ankle"),
    (r"toe", "foot"),
    (r"clavicle|shoulder01", "collar"),
    (r"upperarm", "shoulder"),
    (r"lowerarm", "elbow"),
    (r"wrist|metacarpal|finger1", "wrist"),
    (r"finger", "hand"),
    (r"neck", "neck"),
    (r"", "head"),  # jaw, tongue, eyes and all of the face
)
SIDES = {"left": ".L", "right": ".R"}
# The distal halves of the limbs move on their own in the fine rig: bones 24, 25, ... 31.
DISTAL_HALVES = ("upperarm02", "lowerarm02", "upperleg02", "lowerleg02")


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
        neighbours = self.neighbours
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
    def neighbours(self) -> dict[int, set[int]]:
        """The vertices that share a quad's side with each vertex."""
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
            for n in self.neighbours[v] & place.keys():
                laplacian[place[v], place[n]] = -1 / np.linalg.norm(
                    self.vertices[v] - self.vertices[n]
                )
        np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
        free = len(inner)
        # |L x|^2 over the smoothed vertices and the inner rim: the outer rim lacks neighbours.
        complete = np.array([self.neighbours[v] <= place.keys() for v in vertices])
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


# A joint stands at the mean of the heads of these bones.
PLACED = {
    "spine1": ("spine03",),
    "spine2": ("spine02",),
    "spine3": ("spine01",),
    "hip": ("upperleg01",),
    "knee": ("lowerleg01",),
    "ankle": ("foot",),
    "foot": tuple(f"toe{i}-1" for i in range(1, 6)),
    "neck": ("neck01",),
    "head": ("head",),
    "collar": ("clavicle",),
    "shoulder": ("upperarm01",),
    "elbow": ("lowerarm01",),
    "wrist": ("wrist",),
    "hand": tuple(f"finger{i}-1" for i in range(2, 6)),
}


@dataclass(frozen=True, eq=False)
class MakeHumanRig:
    """Joints and skinning weights of the base mesh.

    Attributes:
        joints: (24, 19158), each joint as a mean of base vertices, linear in shape.
        knuckles: (3, 19158), first joints of the left index, middle and little finger.
        fine_weights: (13380, 32), rows sum to one.
    """

    joints: csr_array
    knuckles: csr_array
    fine_weights: Array

    @property
    def weights(self) -> Array:
        """Weights (13380, 24) for linear blend skinning, with both halves of a limb added."""
        return coarse(self.fine_weights)


def read_rig(wheel: Wheel, mesh: BaseMesh) -> MakeHumanRig:
    """The rig of the wheel."""
    bones = wheel.json("mpfb2/rigs/standard/rig.default.json")
    influences = wheel.json("mpfb2/rigs/standard/weights.default.json")["weights"]

    def mean_of_heads(names: list[str]) -> Array:
        heads = [_mean_of(_head(bones[name]["head"], mesh), mesh) for name in names]
        mean: Array = np.mean(heads, axis=0)
        return mean

    places = [mean_of_heads(_bones_of(name)) for name in JOINT_NAMES[1:]]
    pelvis = _mean_of(mesh.groups["joint-pelvis"], mesh)
    return MakeHumanRig(
        joints=csr_array(np.array([pelvis, *places])),
        knuckles=csr_array(np.array([mean_of_heads([f"finger{i}-1.L"]) for i in (2, 3, 5)])),
        fine_weights=_fine_weights(influences),
    )


def carrier(bone: str) -> int:
    """The joint that carries a bone: `lowerarm02.L` -> 18, the left elbow."""
    kind = next(joint for pattern, joint in CARRIED if re.match(pattern, bone))
    side = {".L": "left_", ".R": "right_"}.get(bone[-2:], "")
    return JOINT[side + kind] if side + kind in JOINT else JOINT[kind]


def _fine_weights(influences: dict[str, list[tuple[int, float]]]) -> Array:
    weights = np.zeros((N_BODY, N_FINE))
    halves = [f"{half}{side}" for half in DISTAL_HALVES for side in SIDES.values()]
    for bone, pairs in influences.items():
        column = N_JOINTS + halves.index(bone) if bone in halves else carrier(bone)
        for vertex, weight in pairs:
            if vertex < N_BODY:
                weights[vertex, column] += weight
    weights /= weights.sum(axis=1, keepdims=True)
    return weights


def _bones_of(joint: str) -> list[str]:
    side, _, kind = joint.rpartition("_")
    return [name + SIDES.get(side, "") for name in PLACED[kind]]


def _head(head: dict[str, Any], mesh: BaseMesh) -> list[int]:
    match head["strategy"]:
        case "CUBE":
            return list(mesh.groups[head["cube_name"]])
        case "VERTEX":
            return [head["vertex_index"]]
        case _:
            return list(head["vertex_indices"])


def _mean_of(vertices: list[int], mesh: BaseMesh) -> Array:
    row = np.zeros(len(mesh.vertices))
    row[vertices] = 1 / len(vertices)
    return row
