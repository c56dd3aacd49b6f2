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
