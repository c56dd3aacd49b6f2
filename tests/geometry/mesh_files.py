"""Mesh files made by hand, field by field."""

import json
import struct
from typing import Any

import numpy as np

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
LITTLE, BIG = "binary_little_endian", "binary_big_endian"


def glb(told: object, binary: bytes | None = None) -> bytes:
    """A .glb of this JSON and these bytes."""
    text = told if isinstance(told, bytes) else json.dumps(told).encode()
    chunks = b""
    for kind, chunk in ((b"JSON", text), (b"BIN\0", binary)):
        if chunk is not None:
            padded = chunk + b" " * (-len(chunk) % 4)
            chunks += struct.pack("<I", len(padded)) + kind + padded
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


POSITIONS = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
CORNERS = {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"}
PART = {"attributes": {"POSITION": 0}, "indices": 1}


def square(**changed: Any) -> bytes:
    """Two triangles as a scene of one node, with some of its JSON changed."""
    told: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [PART]}],
        "accessors": [POSITIONS, CORNERS],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": 72}],
    }
    return glb({**told, **changed}, VERTICES.tobytes() + FACES.tobytes())


SKINNED = {
    "attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2, "JOINTS_1": 1, "WEIGHTS_1": 3}
}


def skinned(**changed: Any) -> tuple[bytes, np.ndarray]:
    """A .glb whose mesh two joints pose, and where that puts its vertices (5, 3) m.

    Joints are in centimetres, z up, below a node that scales and turns them; the mesh's node has a
    scale of its own, which does not count (glTF 2.0, section 3.7.3.3). The upper joint is bent by a
    quarter turn about x; weights add up to 1 or not, and are listed in two sets; the second vertex
    has none, and follows the joint that it lists first.
    """
    places = np.array([[0, 0, 0], [1, 5, 0], [0, 10, 2], [-1, 15, 0], [0, 18, 1]], "<f4") / 10
    joints = np.array([[0, 1, 0, 0]] * 5, "u1")
    weights, more = np.zeros((2, 5, 4), "<f4")
    weights[:4, :2] = [[3, 0], [0, 0], [0.5, 0.25], [0, 1]]
    more[2, 1], more[4, 1] = 0.25, 0.1
    faces = np.array([[0, 1, 2], [2, 3, 4]], "<u4")
    binds = np.zeros((2, 4, 4))
    for bind, height in zip(binds, (0.0, 100.0), strict=True):  # from metres, y up, to a joint
        bind[:3, :3] = 100 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        bind[:, 3] = 0, 0, -height, 1
    arrays = [places, joints, weights, more, faces, binds.swapaxes(1, 2).astype("<f4")]
    kinds = [(5126, "VEC3"), (5121, "VEC4"), (5126, "VEC4"), (5126, "VEC4"), (5125, "SCALAR")]
    views, content = [], b""
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(content), "byteLength": array.nbytes})
        content += array.tobytes() + b"\0" * (-array.nbytes % 4)
    half = float(np.sqrt(0.5))
    told: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"rotation": [-half, 0, 0, half], "scale": [0.01] * 3, "children": [1, 3]},
            {"name": "low", "children": [2]},
            {"name": "up", "translation": [0, 0, 100], "rotation": [half, 0, 0, half]},
            {"mesh": 0, "skin": 0, "scale": [0.01] * 3},
        ],
        "meshes": [{"primitives": [SKINNED | {"indices": 4}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 5}],
        "accessors": [
            {"bufferView": k, "componentType": code, "count": n, "type": kind}
            for k, ((code, kind), n) in enumerate(
                zip([*kinds, (5126, "MAT4")], (5, 5, 5, 5, 6, 2), strict=True)
            )
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(content)}],
    }
    bent = np.stack([places[:, 0], 1 - places[:, 2], places[:, 1] - 1], axis=1)
    share = np.array([0, 0, 0.5, 1, 1])[:, None]
    return glb(told | changed, content), (1 - share) * places + share * bent


def positions(**changed: Any) -> bytes:
    """The same with the accessor of its positions changed."""
    kept = {key: value for key, value in (POSITIONS | changed).items() if value is not None}
    return square(accessors=[kept, CORNERS])


def ply(header: str, data: bytes = b"", kind: str = "ascii") -> bytes:
    """A .ply of these lines."""
    return f"ply\nformat {kind} 1.0\n{header}\nend_header\n".encode() + data


def claims(vertices: int, faces: int = 0) -> str:
    """The header of a .ply."""
    return (
        f"element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list uchar int vertex_indices"
    )
