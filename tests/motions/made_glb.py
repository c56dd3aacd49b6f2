"""A skinned, animated .glb that is put together byte by byte, as other programs make them."""

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from scipy.spatial.transform import Rotation

NAMES = ("hips", "spine", "leg")
OFFSETS = np.array([[0.0, 0.0, 100.0], [0.0, 0.0, 50.0], [10.0, 0.0, -45.0]])  # cm, z up
TIMES = np.array([0.0, 0.1, 0.2, 0.3])


def turns() -> np.ndarray:
    """Rotation vectors (4, 3, 3) of three joints in four keys, about their own axes."""
    return np.random.default_rng(0).normal(scale=0.5, size=(4, 3, 3))


def made(
    change: dict[str, Any] | None = None,
    *,
    step: bool = False,
    cubic: bool = False,
    floor: bool = False,
    stretched: float = 0.0,
) -> bytes:
    """A .glb: centimetres and z up below an armature that scales and turns, two buffers of which
    one is text, a node between joints, rotations as normalized integers, a sparse translation.
    """
    first, second = bytearray(), bytearray()
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []

    def view(array: np.ndarray, into: bytearray) -> int:
        views.append({"buffer": int(into is second), "byteOffset": len(into)})
        views[-1]["byteLength"] = array.nbytes
        into.extend(array.tobytes() + bytes(-array.nbytes % 4))
        return len(views) - 1

    def accessor(array: np.ndarray, kind: str, code: int, into: bytearray, **more: Any) -> int:
        told = {"bufferView": view(array, into), "componentType": code, "type": kind}
        accessors.append({**told, "count": len(array), **more})
        return len(accessors) - 1

    rotations = Rotation.from_rotvec(turns().reshape(-1, 3)).as_quat().reshape(4, 3, 4)
    rotations[2] *= -1  # the same rotations, on the other side
    times = accessor(TIMES.astype("<f4"), "SCALAR", 5126, first)
    samplers, channels = [], []
    for k in range(3):
        q = np.rint(rotations[:, k] * 32767).astype("<i2")
        output = accessor(q, "VEC4", 5122, second, normalized=True)
        way = "STEP" if step else "LINEAR"
        if cubic:
            flat = np.zeros((4, 3, 4), "<f4")
            flat[:, 1] = rotations[:, k]
            output, way = accessor(flat.reshape(12, 4), "VEC4", 5126, second), "CUBICSPLINE"
        samplers.append({"input": times, "output": output, "interpolation": way})
        channels.append({"sampler": k, "target": {"node": (1, 3, 4)[k], "path": "rotation"}})
    moved = OFFSETS[0] + np.array([[5.0, 0, 0], [7, 0, 0]])  # in keys 2 and 3; zero else
    zeros = {"componentType": 5126, "type": "VEC3", "count": 4}
    where = view(np.array([0, 1, 2, 3], dtype="<u1"), first)
    there = view(np.vstack([OFFSETS[:1], OFFSETS[:1], moved]).astype("<f4"), first)
    sparse = {"count": 4, "indices": {"bufferView": where, "componentType": 5121}}
    accessors.append({**zeros, "sparse": {**sparse, "values": {"bufferView": there}}})
    samplers.append({"input": times, "output": len(accessors) - 1})
    channels.append({"sampler": 3, "target": {"node": 1, "path": "translation"}})
    channels.append({"sampler": 3, "target": {"node": 5, "path": "weights"}})
    if stretched:
        grown = np.tile(OFFSETS[2], (4, 1)) + np.linspace(0, stretched, 4)[:, None]
        output = accessor(grown.astype("<f4"), "VEC3", 5126, first)
        samplers.append({"input": times, "output": output})
        channels.append({"sampler": 4, "target": {"node": 4, "path": "translation"}})
    rest = np.array([OFFSETS[0], OFFSETS[0] + OFFSETS[1], OFFSETS[0] + OFFSETS[2]])
    inverse = np.tile(np.eye(4), (3, 1, 1))
    inverse[:, 3, :3] = -rest
    joints = [1, 3, 4]
    if floor:
        joints, inverse = [0, *joints], np.concatenate([np.eye(4)[None], inverse])
    bound = accessor(inverse.astype("<f4").reshape(-1, 16), "MAT4", 5126, second)
    half = float(np.sqrt(0.5))
    nodes = [
        {"name": "armature", "rotation": [-half, 0, 0, half], "scale": [0.01] * 3},
        {"name": "hips", "translation": OFFSETS[0].tolist(), "children": [2, 4]},
        {"translation": (0.4 * OFFSETS[1]).tolist(), "children": [3]},
        {"name": "spine", "translation": (0.6 * OFFSETS[1]).tolist()},
        {"name": "leg", "translation": OFFSETS[2].tolist()},
        {"mesh": 0, "skin": 0},
    ]
    nodes[0]["children"] = [1, 5]
    text = "data:application/octet-stream;base64," + base64.b64encode(bytes(second)).decode()
    document = {
        "asset": {"version": "2.0", "generator": "somebody"},
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {}}]}],
        "skins": [{"joints": joints, "inverseBindMatrices": bound}],
        "animations": [{"name": "walk", "samplers": samplers, "channels": channels}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [
            {"byteLength": len(first)},
            {"byteLength": len(second), "uri": text},
        ],
    } | (change or {})
    head = json.dumps(document).encode()
    head += b" " * (-len(head) % 4)
    parts = [(b"JSON", head), (b"BIN\0", bytes(first))]
    body = b"".join(len(p).to_bytes(4, "little") + kind + p for kind, p in parts)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


def write_text(path: Path, change: dict[str, Any] | None = None, name: str = "walk.bin") -> None:
    """The same as .gltf, with the binary part in a file beside it."""
    content = made(change)
    length = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + length])
    document["buffers"][0].setdefault("uri", quote(name))
    (path.parent / name).write_bytes(content[28 + length :])
    path.write_text(json.dumps(document))


def places_of(rotations: np.ndarray, trans: np.ndarray) -> np.ndarray:
    """Where the joints are, (4, 3, 3) m, by hand: y up, of rotations in centimetres and z up."""
    R = Rotation.from_rotvec(rotations.reshape(-1, 3)).as_matrix().reshape(-1, 3, 3, 3)
    root = trans
    spine = root + np.einsum("tij,j->ti", R[:, 0], OFFSETS[1])
    leg = root + np.einsum("tij,j->ti", R[:, 0], OFFSETS[2])
    places = np.stack([root, spine, leg], axis=1)
    return 0.01 * places[..., [0, 2, 1]] * [1, 1, -1]


TRANS = OFFSETS[0] + np.array([[0.0, 0, 0], [0, 0, 0], [5, 0, 0], [7, 0, 0]])
