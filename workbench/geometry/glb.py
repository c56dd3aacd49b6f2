"""glTF 2.0 in its binary form (.glb): positions and triangles, where the scene puts them.

A file of a few bytes can show one mesh a million times, claim billions of numbers that no bytes
stand for, or hang its nodes on each other in a circle. So numbers are views of the file's own
bytes, each node is visited once, and what is shown again is paid for. (Khronos Group, glTF 2.0
Specification.)
"""

from typing import Any

import numpy as np

from workbench.arrays import Array, Index
from workbench.geometry.glb_document import (
    LOCAL,
    GlbDocument,
    children,
    local_motion,
    several,
)
from workbench.geometry.gltf_buffers import document_of

POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6  # modes of primitives; the others are lines
FREE_BYTES = 2**28  # that all parts together may take, however small the file is
PER_BYTE = 16  # further bytes that they may take for each byte of the file
LEAST = 2**14  # bytes that a part counts as at least, for placing one takes time


def parse_glb(content: bytes) -> tuple[Array, Index]:
    """Vertices (N, 3) in m and triangles (F, 3) of all parts, one after the other.

    Raises ValueError (BadFile of its JSON) with what is wrong.
    """
    document = document_of(content)
    places = _places(document)
    vertices, faces = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
    count, room = 0, FREE_BYTES + PER_BYTE * len(content)
    for number, mesh in enumerate(several(document.json, "meshes")):
        motions = places.get(number, [])
        for primitive in several(mesh, "primitives") if motions else []:
            positions, triangles = _part(document, primitive)
            room -= len(motions) * max(positions.nbytes + triangles.nbytes, LEAST)
            if room < 0:
                raise ValueError(
                    "its scene shows the same parts again and again, so that all of them take more "
                    f"than {PER_BYTE} times the file's {len(content):,} bytes"
                )
            for motion in motions:
                vertices.append(_moved(positions, motion))
                faces.append(triangles + count)
                count += len(positions)
    return np.concatenate(vertices), np.concatenate(faces)


def _places(document: GlbDocument) -> dict[int, list[Array]]:
    """The motions (4, 4) to where the scene shows each mesh, in the order of the nodes' names."""
    json = document.json
    scene = document.entry("scenes", json.get("scene", 0)) if "scenes" in json else {}
    waiting = [(child, np.eye(4)) for child in children(scene, "nodes")]
    seen: set[int] = set()
    found: dict[int, list[tuple[str, int, Array]]] = {}
    while waiting:
        number, motion = waiting.pop()
        node = document.entry("nodes", number)
        if number in seen:
            raise ValueError(f"nodes[{number}] hangs on two others, or on itself")
        seen.add(number)
        if not node.keys().isdisjoint(LOCAL):
            with np.errstate(all="ignore"):  # what is not finite then is refused as a vertex
                motion = motion @ local_motion(node)
        waiting += [(child, motion) for child in children(node, "children")]
        if "mesh" in node:
            document.entry("meshes", node["mesh"])
            key = (str(node.get("name", number))[:100], number)
            found.setdefault(node["mesh"], []).append((*key, motion))
    return {
        mesh: [motion for *_, motion in sorted(shown_at, key=lambda place: place[:2])]
        for mesh, shown_at in found.items()
    }


def _part(document: GlbDocument, primitive: dict[str, Any]) -> tuple[Array, Index]:
    """Vertices and triangles of one primitive; lines are left out, and points have no triangles."""
    mode, attributes = primitive.get("mode", TRIANGLES), primitive.get("attributes")
    none = np.zeros((0, 3), dtype=np.int64)
    if mode not in (POINTS, TRIANGLES, STRIP, FAN) or not isinstance(attributes, dict):
        return np.zeros((0, 3)), none
    stored = document.numbers(attributes.get("POSITION"), "VEC3", 3)
    with np.errstate(invalid="ignore"):  # what is no number then is refused by the mesh
        positions = stored.astype(np.float64)
    if stored.dtype.kind in "iu" and _accessor_is_normalized(document, attributes):
        positions = np.maximum(positions / np.iinfo(stored.dtype).max, -1)
    if mode == POINTS:
        return positions, none
    if "indices" in primitive:
        order = document.numbers(primitive["indices"], "SCALAR", 1).astype(np.int64).ravel()
    else:
        order = np.arange(len(positions))
    return positions, _triangles(order, mode)


def _accessor_is_normalized(document: GlbDocument, attributes: dict[str, Any]) -> bool:
    return document.entry("accessors", attributes["POSITION"]).get("normalized") is True


def _triangles(order: Index, mode: int) -> Index:
    """Triangles (F, 3) of the vertices in this order."""
    if mode == TRIANGLES:
        if len(order) % 3:
            raise ValueError(f"{len(order):,} corners are no triangles of three")
        return order.reshape(-1, 3)
    if len(order) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    if mode == FAN:
        first = np.full(len(order) - 2, order[0])
        return np.column_stack([first, order[1:-1], order[2:]])
    strip: Index = np.column_stack([order[:-2], order[1:-1], order[2:]])
    strip[1::2] = strip[1::2, [1, 0, 2]]
    a, b, c = strip.T
    area: Index = strip[(a != b) & (b != c) & (a != c)]  # the others lead from strip to strip
    return area


def _moved(positions: Array, motion: Array) -> Array:
    if np.array_equal(motion, np.eye(4)):
        return positions
    with np.errstate(all="ignore"):
        return np.asarray(positions @ motion[:3, :3].T + motion[:3, 3])
