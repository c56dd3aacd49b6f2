"""A skinned body as a glTF file (.glb) that viewers and engines move by themselves.

Each pose is a key frame: joints turn, and one morph target holds what the pose adds to the rest
surface. glTF adds morph targets first and skins then, which is SMPL's own order, so at the key
frames the file says what the body says, in single precision; in between both are interpolated.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadBody
from workbench.writing import replacing

FLOAT, UNSIGNED = 5126, 5125  # glTF's codes of component types
SHORT = 5123
CODES = {"float32": FLOAT, "uint32": UNSIGNED, "uint16": SHORT}
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
ATTRIBUTES, ELEMENTS = 34962, 34963  # what a buffer view is for


class Chunk:
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


def write_gltf(
    path: str | Path,
    body: SkinnedBody | TriangleBody,
    poses: ArrayLike,
    betas: ArrayLike | None = None,
    *,
    trans: ArrayLike | None = None,
    seconds: float = 1.0,
) -> None:
    """Write one person in poses (P, K, 3) rad as a .glb with a skeleton, `seconds` from key to key.

    `trans` (P, 3) m moves the root. Whole or not at all. Raises BadBody for what no skinned glTF
    can say: triangle bodies, other skinnings than linear blending, and bodies drawn in another
    pose than zero.
    """
    path = Path(path)
    if isinstance(body, TriangleBody):
        raise BadBody(
            f"body {body.name!r} has no bones: its surface is the solution of a linear system, "
            "and a glTF only blends motions of bones; write a mesh of every pose, with write_mesh"
        )
    if not body.is_smpl or body.bind_pose.any():
        raise BadBody(
            f"body {body.name!r} is not skinned as a glTF is, linearly from a zero pose; write a "
            "mesh of every pose, with write_mesh"
        )
    content = _glb(
        body,
        np.asarray(poses, dtype=float).reshape(-1, body.n_joints, 3),
        np.zeros(body.n_betas) if betas is None else np.asarray(betas, dtype=float),
        None if trans is None else np.asarray(trans, dtype=float).reshape(-1, 3),
        seconds,
    )
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def _glb(
    body: SkinnedBody, poses: Array, betas: Array, trans: Array | None, seconds: float
) -> bytes:
    chunk, K = Chunk(), body.n_joints
    rest = body.template + body.shapedirs @ betas
    J = body.numeric.skeleton.positions(betas)
    features = [body.kinematics.motion(pose, betas).features for pose in poses]
    attributes = {"POSITION": chunk.add(rest, "float32", ATTRIBUTES)}
    attributes |= _influences(body.weights, chunk)
    primitive = {
        "attributes": attributes,
        "indices": chunk.add(body.faces.ravel(), "uint32", ELEMENTS),
        "targets": [
            {"POSITION": chunk.add(body.posedirs @ f, "float32", ATTRIBUTES)} for f in features
        ],
    }
    inverse = np.tile(np.eye(4), (K, 1, 1))
    inverse[:, 3, :3] = -J  # by columns: the fourth is the translation
    offsets = J - np.where(np.arange(K)[:, None] > 0, J[list(body.parents)], 0.0)
    nodes: list[dict[str, Any]] = [
        {"name": name, "translation": offset.tolist()}
        for name, offset in zip(body.joint_names, offsets, strict=True)
    ]
    for k, parent in enumerate(body.parents[1:], start=1):
        nodes[parent].setdefault("children", []).append(k)
    nodes.append({"name": body.name, "mesh": 0, "skin": 0})
    document = {
        "asset": {"version": "2.0", "generator": "workbench"},
        "scene": 0,
        "scenes": [{"nodes": [0, K]}],
        "nodes": nodes,
        "meshes": [{"primitives": [primitive], "weights": [0.0] * len(poses)}],
        "skins": [
            {
                "joints": list(range(K)),
                "skeleton": 0,
                "inverseBindMatrices": chunk.add(inverse.reshape(K, 16), "float32"),
            }
        ],
        "animations": [_animation(poses, None if trans is None else J[0] + trans, seconds, chunk)],
        "accessors": chunk.accessors,
        "bufferViews": chunk.views,
        "buffers": [{"byteLength": len(chunk.data)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    parts = [(b"JSON", text), (b"BIN\0", bytes(chunk.data))]
    body_bytes = b"".join(len(p).to_bytes(4, "little") + kind + p for kind, p in parts)
    sizes = (2).to_bytes(4, "little") + (12 + len(body_bytes)).to_bytes(4, "little")
    return b"glTF" + sizes + body_bytes


def _influences(weights: Array, chunk: Chunk) -> dict[str, int]:
    """Joints and weights of every vertex, four at a time, the largest first."""
    order = np.argsort(-weights, axis=1, kind="stable")
    sets = -(-int((weights > 0).sum(axis=1).max()) // 4)
    found = {}
    for s in range(sets):
        joints = order[:, 4 * s : 4 * s + 4]
        shares = np.take_along_axis(weights, joints, axis=1)
        found[f"JOINTS_{s}"] = chunk.add(np.where(shares > 0, joints, 0), "uint16", ATTRIBUTES)
        found[f"WEIGHTS_{s}"] = chunk.add(shares, "float32", ATTRIBUTES)
    return found


def _animation(poses: Array, root: Array | None, seconds: float, chunk: Chunk) -> dict[str, Any]:
    """The key frames of all joints, and of the place of the root (P, 3) m if it moves."""
    P, K = poses.shape[:2]
    q = _on_one_side(Rotation.from_rotvec(poses.reshape(-1, 3)).as_quat().reshape(P, K, 4))
    times = chunk.add(seconds * np.arange(P), "float32")
    outputs = [chunk.add(q[:, k], "float32") for k in range(K)]
    outputs.append(chunk.add(np.eye(P).ravel(), "float32"))  # each pose its own morph target
    where = [{"node": k, "path": "rotation"} for k in range(K)] + [{"node": K, "path": "weights"}]
    if root is not None:
        outputs.append(chunk.add(root, "float32"))
        where.append({"node": 0, "path": "translation"})
    return {
        "samplers": [{"input": times, "output": out} for out in outputs],
        "channels": [{"sampler": i, "target": target} for i, target in enumerate(where)],
    }


def _on_one_side(q: Array) -> Array:
    """Quaternions (P, K, 4) xyzw, of which neighbours in time lie on one side.

    q and -q are the same rotation, and a viewer may interpolate the long way round between q and
    what is nearly -q.
    """
    same = np.where((q[1:] * q[:-1]).sum(axis=2) < 0, -1.0, 1.0)
    signs = np.concatenate([np.ones((1, q.shape[1])), np.cumprod(same, axis=0)])
    return np.asarray(q * signs[:, :, None])
