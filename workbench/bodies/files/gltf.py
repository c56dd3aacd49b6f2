"""A skinned body as a glTF file (.glb) that viewers and engines move by themselves.

Each pose is a key frame: joints turn, and morph targets add to the rest surface what the pose adds
to it. glTF adds morph targets first and skins then, which is SMPL's own order, so at the key
frames the file says what the body says, in single precision; in between both are interpolated.
Further morph targets are the shape directions, at zero for the person of the file. They move the
surface alone, as a glTF has no means to move joints with them. Those of betas that move follow the
frames, and the joints with them: a joint at J that such betas take to J + d turns about there,
so that v goes to R (v - J - d) + J + d = R (v - J) + J + (I - R) d. A node's place gets (I - R) d.

Pose blend shapes P f(theta) are written as a few morph targets: the best C directions for the poses
of the file, in the sum of squares, are singular vectors of the (3 N, T) matrix of P f(theta_t)
(Eckart and Young, 1936); with P = Q R, they are Q times those of the small matrix R f. (Khronos
Group, glTF 2.0 Specification, sections 3.6, buffers and accessors, and 4.4, the file.)
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.blocks.checks import reals
from workbench.bodies.body import arguments
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument, BadBody
from workbench.geometry.meshes import Mesh
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.solids import vertex_normals
from workbench.writing import write_file

CODES = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}  # glTF's component types
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
ATTRIBUTES, ELEMENTS = 34962, 34963  # what a buffer view is for


class GltfBuffer:
    """The numbers of a file, and where each array is in them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: ArrayLike, kind: str, target: int | None = None) -> int:
        """The number of the accessor of an array (n,) or (n, width), stored as `kind`."""
        rows = np.ascontiguousarray(array, dtype=kind)
        rows = rows.reshape(len(rows), -1)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": rows.nbytes}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.data += rows.astype(rows.dtype.newbyteorder("<")).tobytes()
        self.data += bytes(-len(self.data) % 4)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": CODES[kind],
                "count": len(rows),
                "type": KINDS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def file(self, document: dict[str, Any]) -> bytes:
        """The file: a document without the arrays, and these arrays."""
        whole = document | {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        parts = [(b"JSON", text), (b"BIN\0", bytes(self.data))]
        body = b"".join(len(p).to_bytes(4, "little") + kind + p for kind, p in parts)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


LEAST_DIRECTION = 1e-9  # m, summed over all vertices and poses: a smaller direction is rounding
POSES_AT_ONCE = 32  # poses whose surfaces are in memory at once


@dataclass(frozen=True, eq=False)
class Correctives:
    """C morph targets that stand for a body's pose blend shapes in T poses.

    Attributes:
        shapes: (C, N, 3) m, added to the rest surface, as single precision holds them.
        shares: (T, C) how much of each, at most one in size, as single precision holds them.
        mean: how far vertices of the posed surface are off on average, in m.
        largest: the same for the vertex and the pose where it is most, in m.
    """

    shapes: Array
    shares: Array
    mean: float
    largest: float

    def __str__(self) -> str:
        return (
            f"{len(self.shapes)} correctives: vertices are off by {1e3 * self.mean:.2g} mm on "
            f"average and {1e3 * self.largest:.2g} mm at most"
        )


def correctives_of(
    body: SkinnedBody, poses: Array, betas: Array, count: int | None = None
) -> Correctives:
    """The best `count` correctives of poses (T, K, 3) rad; None: as many as make them exact.

    Raises BadArgument for a count below zero.
    """
    if count is not None and (type(count) is not int or count < 0):
        raise BadArgument(f"correctives is a whole number from 0, or None for all, not {count!r}")
    T, N = len(poses), body.n_vertices
    people = np.tile(betas, (T, 1))
    features = body.kinematics.motion(poses, people).features  # (T, F)
    P = body.posedirs.reshape(3 * N, -1)
    mixed, shares = np.zeros((T, 0)), np.zeros((T, 0))  # mixtures of poses that are the shapes
    if P.shape[1] and count != 0:
        _, sizes, turns = np.linalg.svd(np.linalg.qr(P, mode="r") @ features.T, full_matrices=False)
        rank = int((sizes > LEAST_DIRECTION).sum())
        used = turns[: rank if count is None else min(rank, count)].T  # columns of length one
        largest = np.abs(used).max(axis=0, initial=1e-300)
        mixed, shares = used * largest, used / largest
    shapes, shares = (
        a.astype(np.float32).astype(np.float64) for a in (P @ (features.T @ mixed), shares)
    )
    total, farthest = 0.0, 0.0
    for first in range(0, T, POSES_AT_ONCE):
        rows = slice(first, first + POSES_AT_ONCE)
        missing = (features[rows] @ P.T - shares[rows] @ shapes.T).reshape(-1, N, 3)
        R = body.kinematics.motion(poses[rows], people[rows]).G[..., :3]
        blended = (body.weights @ R.reshape(len(R), -1, 9)).reshape(-1, N, 3, 3)
        off = np.linalg.norm(np.einsum("tnij,tnj->tni", blended, missing), axis=2)
        total, farthest = total + float(off.sum()), max(farthest, float(off.max()))
    targets = np.moveaxis(shapes.reshape(N, 3, -1), 2, 0)
    return Correctives(targets, shares, total / (T * N), farthest)


LEAST_MOTION = 1e-9  # m: a joint that betas move by less stays where it is
TWO_BYTES, ONE_BYTE = 2**16, 2**8  # how many vertices or joints two bytes, or one, can count


def write_gltf(
    path: str | Path,
    body: SkinnedBody,
    poses: ArrayLike,
    betas: ArrayLike | None = None,
    *,
    trans: ArrayLike | None = None,
    moving: ArrayLike | None = None,
    seconds: float = 1.0,
    correctives: int | None = None,
    shapes: int = 0,
) -> Correctives:
    """Write one person in poses (P, K, 3) rad as a .glb with a skeleton, `seconds` from key to key.

    `trans` (P, 3) or (3,) m moves the root, and `moving` (P, B) is what each pose adds to the
    betas, such as an expression, whose directions become morph targets. `correctives` is the number
    of morph targets that stand for the pose blend shapes: None for as many as the poses need, which
    is exact, 0 for none. The first `shapes` shape directions are morph targets as well, of one
    standard deviation, which the file leaves at zero. The file has the `texture` of a body, and
    vertices on a seam once more after all others. What is returned says how far the surface is off;
    the file's `extras` say it too, and the betas. Whole or not at all.

    Raises BadBody for what no skinned glTF can say: other skinnings than linear blending, bodies
    drawn in another pose than zero or without faces, and a TriangleBody; BadBody also for poses,
    betas or trans of another shape; BadArgument for other numbers of morph targets, for no poses,
    for numbers that are not finite, and for a time between keys that is not positive.
    """
    if not (isinstance(body, SkinnedBody) and body.is_smpl) or body.bind_pose.any():
        raise BadBody(
            f"body {body.name!r} is not skinned as a glTF is, linearly from a zero pose; write a "
            "mesh of every pose, with write_mesh"
        )
    if not len(body.faces):
        raise BadBody(f"body {body.name!r} has no faces, and a glTF shows triangles")
    if type(shapes) is not int or not 0 <= shapes <= body.n_betas:
        raise BadArgument(f"shapes is a whole number from 0 to {body.n_betas}, not {shapes!r:.60}")
    if betas is not None and np.ndim(betas) != 1:
        raise BadBody(f"a glTF shows one person, whose betas are (B,), not {np.shape(betas)}")
    _, (theta, people, places) = arguments(body, poses, betas, trans)
    theta = theta.copy()  # broadcast, it cannot be written, which SciPy asks for
    P, B = len(theta), body.n_betas
    added = np.zeros((P, B)) if moving is None else reals("moving", moving)
    if not P:
        raise BadArgument("there are no poses to write; give at least one")
    if added.shape != (P, B):
        raise BadArgument(f"moving must have shape ({P}, {B}), not {added.shape}")
    if not 0 < seconds < np.inf:
        raise BadArgument(f"the seconds from key to key must be positive, not {seconds}")
    if not all(np.isfinite(numbers).all() for numbers in (theta, people, places, added)):
        raise BadArgument("poses, betas, trans and moving must be finite; leave other frames out")
    targets = correctives_of(body, theta, people[0], correctives)
    moved = None if trans is None else places
    write_file(path, _glb(body, theta, people[0], moved, added, seconds, targets, shapes))
    return targets


def _glb(
    body: SkinnedBody,
    poses: Array,
    betas: Array,
    trans: Array | None,
    added: Array,
    seconds: float,
    correctives: Correctives,
    shapes: int,
) -> bytes:
    buffer, K = GltfBuffer(), body.n_joints
    used = np.flatnonzero(added.any(axis=0)).tolist()  # betas that move
    mesh = _mesh(body, betas, used, correctives, shapes, buffer)
    weights = np.hstack([np.zeros((len(poses), shapes)), added[:, used], correctives.shares])
    J = body.numeric.skeleton.positions(betas)
    inverse = np.tile(np.eye(4), (K, 1, 1))
    inverse[:, 3, :3] = -J  # by columns: the fourth is the translation
    offsets = J - np.where(np.arange(K)[:, None] > 0, J[list(body.parents)], 0.0)
    places = _moving_places(body, poses, used, added, offsets)
    if trans is not None:
        places[0] = places.get(0, J[0]) + trans
    document = {
        "asset": {
            "version": "2.0",
            "generator": "workbench",
            "extras": {
                "body": body.name,
                "betas": betas.tolist(),
                "correctives": len(correctives.shapes),
                "mean_error_m": correctives.mean,
                "largest_error_m": correctives.largest,
            },
        },
        "scene": 0,
        "scenes": [{"nodes": [0, K]}],
        "nodes": _nodes(body, offsets),
        "meshes": [mesh],
        "skins": [
            {
                "joints": list(range(K)),
                "skeleton": 0,
                "inverseBindMatrices": buffer.add(inverse.reshape(K, 16), "float32"),
            }
        ],
        "animations": [_animation(poses, places, weights, seconds, buffer)],
    }
    return buffer.file(document)


def _mesh(
    body: SkinnedBody,
    betas: Array,
    used: list[int],
    correctives: Correctives,
    shapes: int,
    buffer: GltfBuffer,
) -> dict[str, Any]:
    """The surface at rest with its morph targets: shapes, betas that are `used`, correctives."""
    rest = body.template + body.shapedirs @ betas
    rows, faces, uv = Mesh(rest, body.faces, *body.texture).unwrapped()
    normals = vertex_normals(rest, body.faces)
    normals[~normals.any(axis=1)] = [0.0, 1.0, 0.0]  # of a vertex of no face: glTF takes no zeros
    attributes = {
        "POSITION": buffer.add(rest[rows], "float32", ATTRIBUTES),
        "NORMAL": buffer.add(normals[rows], "float32", ATTRIBUTES),
    }
    attributes |= _influences(body.weights[rows], buffer)
    if uv is not None:  # glTF's v goes downwards
        flipped = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])
        attributes["TEXCOORD_0"] = buffer.add(flipped, "float32", ATTRIBUTES)
    kind = "uint16" if len(rows) < TWO_BYTES else "uint32"
    indices = buffer.add(faces.ravel(), kind, ELEMENTS)
    primitive: dict[str, Any] = {"attributes": attributes, "indices": indices}
    mesh: dict[str, Any] = {"primitives": [primitive]}
    directions = np.moveaxis(body.shapedirs, 2, 0)
    morphs = [*directions[:shapes], *directions[used], *correctives.shapes]
    if morphs:
        names = [f"betas[{b}]" for b in range(shapes)] + [f"moving betas[{b}]" for b in used]
        names += [f"pose corrective {c}" for c in range(len(correctives.shapes))]
        primitive["targets"] = [
            {"POSITION": buffer.add(morph[rows], "float32", ATTRIBUTES)} for morph in morphs
        ]
        mesh |= {"weights": [0.0] * len(morphs), "extras": {"targetNames": names}}
    return mesh


def _nodes(body: SkinnedBody, offsets: Array) -> list[dict[str, Any]]:
    """The joints, each at its offset (K, 3) m from its parent, and after them the surface."""
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": offset.tolist()}
        for name, offset in zip(body.joint_names, offsets, strict=True)
    ]
    for k, parent in enumerate(body.parents[1:], start=1):
        nodes[parent].setdefault("children", []).append(k)
    return [*nodes, {"name": body.name, "mesh": 0, "skin": 0}]


def _moving_places(
    body: SkinnedBody, poses: Array, used: list[int], added: Array, offsets: Array
) -> dict[int, Array]:
    """Where each joint that moving betas displace is in its parent's frame, (P, 3) m by joint."""
    shifts = np.einsum("kab,pb->pka", body.numeric.skeleton.by_betas[:, :, used], added[:, used])
    R = matrix_from_vector(poses)
    return {
        k: offsets[k] + shifts[:, k] - np.einsum("pij,pj->pi", R[:, k], shifts[:, k])
        for k in range(body.n_joints)
        if np.abs(shifts[:, k]).max(initial=0.0) > LEAST_MOTION
    }


def _influences(weights: Array, buffer: GltfBuffer) -> dict[str, int]:
    """Joints and weights of every vertex, four at a time, the largest first."""
    order = np.argsort(-weights, axis=1, kind="stable")
    sets = -(-int((weights > 0).sum(axis=1).max()) // 4)
    attributes = {}
    for s in range(sets):
        joints = order[:, 4 * s : 4 * s + 4]
        shares = np.take_along_axis(weights, joints, axis=1)
        kind = "uint8" if weights.shape[1] <= ONE_BYTE else "uint16"
        joints = np.where(shares > 0, joints, 0)
        padding = np.zeros((len(joints), 4 - joints.shape[1]))  # a body of three joints or less
        joints, shares = (np.hstack([a, padding]) for a in (joints, shares))
        attributes[f"JOINTS_{s}"] = buffer.add(joints, kind, ATTRIBUTES)
        attributes[f"WEIGHTS_{s}"] = buffer.add(shares, "float32", ATTRIBUTES)
    return attributes


def _animation(
    poses: Array, places: dict[int, Array], weights: Array, seconds: float, buffer: GltfBuffer
) -> dict[str, Any]:
    """The key frames of all joints, of morph targets (P, M), and of joints that move (P, 3) m."""
    P, K = poses.shape[:2]
    q = Rotation.from_rotvec(poses.reshape(-1, 3)).as_quat().reshape(P, K, 4)
    # neighbours in time on one side: between q and nearly -q a viewer may go the long way round
    same = np.where((q[1:] * q[:-1]).sum(axis=2) < 0, -1.0, 1.0)
    q[1:] *= np.cumprod(same, axis=0)[:, :, None]
    times = buffer.add(seconds * np.arange(P), "float32")
    outputs = [buffer.add(q[:, k], "float32") for k in range(K)]
    targets = [{"node": k, "path": "rotation"} for k in range(K)]
    if weights.size:
        outputs.append(buffer.add(weights.ravel(), "float32"))
        targets.append({"node": K, "path": "weights"})
    for k, place in places.items():
        outputs.append(buffer.add(place, "float32"))
        targets.append({"node": k, "path": "translation"})
    return {
        "samplers": [{"input": times, "output": output} for output in outputs],
        "channels": [{"sampler": i, "target": target} for i, target in enumerate(targets)],
    }
