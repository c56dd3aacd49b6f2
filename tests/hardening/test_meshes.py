"""Mesh files made to hang, to fill the memory or to read other files: each ends in a sentence."""

import base64
import json
import os
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.hardening.within_limits import Reader, reader
from workbench.errors import BadFile
from workbench.geometry.meshes import read_mesh, write_mesh

SECONDS, MEGABYTES = 5.0, 1000
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
DAMAGED = "is damaged, or no .* file: "


@pytest.fixture(scope="module")
def meshes() -> Iterator[Reader]:
    yield from reader("workbench.geometry.meshes:read_mesh", SECONDS, MEGABYTES)


def glb(told: object, binary: bytes | None = None) -> bytes:
    """A .glb of this JSON and these bytes."""
    text = told if isinstance(told, bytes) else json.dumps(told).encode()
    chunks = b""
    for kind, chunk in ((b"JSON", text), (b"BIN\0", binary)):
        if chunk is not None:
            padded = chunk + b" " * (-len(chunk) % 4)
            chunks += struct.pack("<I", len(padded)) + kind + padded
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def square(**changed: Any) -> bytes:
    """Two triangles as a scene of one node, with some of its JSON changed."""
    told: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": 72}],
    }
    return glb({**told, **changed}, VERTICES.tobytes() + FACES.tobytes())


def positions(**changed: Any) -> bytes:
    """The same with the accessor of its positions changed."""
    accessor = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
    indices = {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"}
    kept = {key: value for key, value in (accessor | changed).items() if value is not None}
    return square(accessors=[kept, indices])


def ply(header: str, data: bytes = b"", kind: str = "ascii") -> bytes:
    """A .ply of these lines."""
    return f"ply\nformat {kind} 1.0\n{header}\nend_header\n".encode() + data


def claims(vertices: int, faces: int = 0) -> str:
    """The header of a .ply."""
    return (
        f"element vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list uchar int vertex_indices"
    )


TRIANGLE = b"0 0 0\n1 0 0\n0 1 0\n"
FACE = b"\3" + bytes(12)
LITTLE, BIG = "binary_little_endian", "binary_big_endian"
MANY = 3_000_000_000
HOSTILE: dict[str, tuple[Callable[[], bytes], str]] = {
    # .glb
    "nothing.glb": (lambda: b"", DAMAGED + "it does not begin as glTF 2.0 does"),
    "zeros.glb": (lambda: bytes(100), DAMAGED + "it does not begin"),
    "version 1.glb": (lambda: b"glTF" + struct.pack("<II", 1, 12), "does not begin as glTF 2.0"),
    "no parts.glb": (lambda: b"glTF" + struct.pack("<II", 2, 12), "its JSON is no object"),
    "cut off.glb": (lambda: square()[:-30], "a part of 72 bytes is cut off"),
    "a part of 4 GB.glb": (
        lambda: b"glTF" + struct.pack("<III", 2, 99, 2**32 - 1) + b"JSON{}",
        "a part of 4,294,967,295 bytes is cut off",
    ),
    "lists in lists.glb": (lambda: glb(b"[" * 400_000), DAMAGED + "RecursionError"),
    "objects in objects.glb": (lambda: glb(b'{"a":' * 400_000), DAMAGED + "RecursionError"),
    "6 million lists.glb": (
        lambda: glb(b"[" + b"[]," * 6_000_000 + b"0]"),
        "6,000,001 lists and objects, too many",
    ),
    "a list.glb": (lambda: glb([]), "its JSON is no object"),
    "a number of 5,000 digits.glb": (lambda: glb(b"9" * 5000), DAMAGED + ".*digits"),
    "entries of one name.glb": (
        lambda: glb(b'{"nodes": [], "nodes": 5}'),
        "two entries called 'nodes'",
    ),
    "3 billion numbers.glb": (lambda: positions(count=MANY), "holds 3,000,000,000 VEC3, but its"),
    "numbers of no bytes.glb": (
        lambda: positions(count=MANY, bufferView=None),
        r"accessors\[0\] is sparse, or compressed by an",
    ),
    "sparse numbers.glb": (lambda: positions(sparse={"count": 1}), "or compressed by an"),
    "numbers before the bytes.glb": (
        lambda: positions(byteOffset=-12),
        "its byteOffset is -12, but must be a whole number",
    ),
    "numbers after the bytes.glb": (lambda: positions(byteOffset=4), "but its bytes are fewer"),
    "half a number.glb": (lambda: positions(count=1.5), "its count is 1.5, but must be a whole"),
    "a long number.glb": (lambda: positions(count=10**4000), "a whole number of 13,288 bits"),
    "a negative number.glb": (lambda: positions(count=-1), "its count is -1"),
    "no type of numbers.glb": (lambda: positions(componentType=[]), "accessors.0. holds 'VEC3'"),
    "an unknown type.glb": (lambda: positions(type="MAT4"), r"holds 'MAT4', but must hold VEC3"),
    "a view without end.glb": (
        lambda: square(bufferViews=[{"buffer": 0, "byteLength": 2**50}] * 2),
        "its bytes are fewer",
    ),
    "rows on each other.glb": (
        lambda: square(bufferViews=[{"buffer": 0, "byteLength": 72, "byteStride": 1}] * 2),
        "its bytes are fewer",
    ),
    "another file.glb": (
        lambda: square(buffers=[{"byteLength": 72, "uri": "/etc/passwd"}]),
        r"buffers\[0\] is in another file, '/etc/passwd', which is not opened",
    ),
    "a file of the web.glb": (
        lambda: square(buffers=[{"byteLength": 72, "uri": "http://127.0.0.1:1/a"}]),
        "is in another file, 'http://127.0.0.1:1/a', which is not opened",
    ),
    "no address.glb": (lambda: square(buffers=[{"uri": 5}]), "is in another file, 5, which"),
    "bad base64.glb": (
        lambda: square(buffers=[{"uri": "data:;base64,A"}]),
        r"buffers\[0\] is no base64",
    ),
    "no bytes.glb": (
        lambda: square(bufferViews=[{"buffer": 1, "byteLength": 48}] * 2),
        r"no buffers\[1\]",
    ),
    "no such accessor.glb": (lambda: square(accessors=[]), r"there is no accessors\[0\]"),
    "no such mesh.glb": (lambda: square(nodes=[{"mesh": 7}]), r"there is no meshes\[7\]"),
    "a mesh by its name.glb": (lambda: square(nodes=[{"mesh": "0"}]), r"there is no meshes\['0'\]"),
    "no such scene.glb": (lambda: square(scene=[0]), r"there is no scenes\[\[0\]\]"),
    "nodes in a circle.glb": (
        lambda: square(nodes=[{"children": [1]}, {"children": [0]}]),
        r"nodes\[0\] hangs on two",
    ),
    "nodes twice on every level.glb": (
        lambda: square(nodes=[*({"children": [i + 1] * 2} for i in range(60)), {"mesh": 0}]),
        r"nodes\[\d+\] hangs on two others, or on itself",
    ),
    "no list of nodes.glb": (lambda: square(nodes={"0": {}}), r"there is no nodes\[0\]"),
    "no list of children.glb": (lambda: square(nodes=[{"children": 5}]), "children are no list"),
    "a place of texts.glb": (
        lambda: square(nodes=[{"mesh": 0, "translation": ["a", 0, 0]}]),
        "a node's place is",
    ),
    "a place of two numbers.glb": (
        lambda: square(nodes=[{"mesh": 0, "scale": [1, 1]}]),
        r"is \[1, 1\], but must be 3 numbers",
    ),
    "an endless place.glb": (
        lambda: square(
            nodes=[
                {
                    "mesh": 0,
                    "scale": [1e308, 1e308, 1e308],
                    "rotation": [0.5, 0.5, 0.5, 0.5],
                    "translation": [1e308] * 3,
                }
            ]
        ),
        "cannot use the mesh .*: vertex .* is .*inf",
    ),
    "a matrix of infinity.glb": (
        lambda: square(
            nodes=[{"children": [1], "matrix": [1e400] * 16}, {"mesh": 0, "scale": [0, 1, 1]}]
        ),
        "cannot use the mesh .*: vertex 0 is .*(nan|inf)",
    ),
    "a rotation of nothing.glb": (
        lambda: square(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]),
        "the rotation of a node is zero",
    ),
    "one mesh a million times.glb": (
        lambda: square(scenes=[{"nodes": list(range(200_000))}], nodes=[{"mesh": 0}] * 200_000),
        "shows the same parts again and again",
    ),
    "one part a million times.glb": (
        lambda: square(
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * 200_000}]
        ),
        "shows the same parts again and again",
    ),
    "parts times nodes.glb": (
        lambda: square(
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * 20_000}],
            scenes=[{"nodes": list(range(20_000))}],
            nodes=[{"mesh": 0}] * 20_000,
        ),
        "shows the same parts again and again",
    ),
    "corners of no vertex.glb": (
        lambda: square(
            accessors=[
                {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"},
            ]
        ),
        "face 0 is .0, 1, 2., but there are 2 vertices",
    ),
    "half a triangle.glb": (
        lambda: square(
            accessors=[
                {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                {"bufferView": 1, "componentType": 5125, "count": 4, "type": "SCALAR"},
            ]
        ),
        "4 corners are no triangles of three",
    ),
    "packed by Draco.glb": (
        lambda: positions(bufferView=None, count=4),
        "such as Draco's, which is not read",
    ),
    # .ply
    "nothing.ply": (lambda: b"", DAMAGED + "it has no header"),
    "no end of its header.ply": (lambda: b"ply\n" + b"comment x\n" * 100_000, "it has no header"),
    "no format.ply": (lambda: b"ply\nend_header\n", "its format is none of"),
    "an unknown format.ply": (lambda: ply("", kind="yaml"), "its header says 'format yaml 1.0'"),
    "3 billion vertices.ply": (
        lambda: ply(claims(MANY), TRIANGLE),
        "claims 'vertex' 3,000,000,000 times, and there are",
    ),
    "3 billion vertices in binary.ply": (
        lambda: ply(claims(MANY), bytes(99), LITTLE),
        "claims 'vertex' 3,000,000,000 times",
    ),
    "more digits than numbers have.ply": (
        lambda: ply(claims(10**4000), TRIANGLE),
        r"its header says 'element vertex 1000.*\.\.\.'",
    ),
    "fewer than none.ply": (lambda: ply(claims(-3), TRIANGLE), "says 'element vertex -3'"),
    "one vertex too many.ply": (
        lambda: ply(claims(4), TRIANGLE),
        "says that it holds 4 times 'vertex', but is",
    ),
    "one vertex too many in binary.ply": (
        lambda: ply(claims(4), bytes(40), LITTLE),
        "says that it holds 4 times 'vertex', but is",
    ),
    "a million properties of a million rows.ply": (
        lambda: ply(
            "element a 20000\n"
            + "".join(f"property list uchar int p{i}\n" for i in range(2000))
            + claims(3),
            b"0\n" * 20_000 + TRIANGLE,
        ),
        "claims 'a' 20,000 times",
    ),
    "a list of 4 billion.ply": (
        lambda: ply(
            claims(3, 1).replace("list uchar", "list uint"), bytes(36) + b"\xff" * 16, LITTLE
        ),
        "a list of 4,294,967,295 numbers is cut off",
    ),
    "a list shorter than none.ply": (
        lambda: ply(
            claims(3, 1).replace("list uchar", "list char"), bytes(36) + b"\xff" * 16, LITTLE
        ),
        "a list of -1 numbers is cut off",
    ),
    "a list of 4 billion in text.ply": (
        lambda: ply(claims(3, 1), TRIANGLE + b"4000000000 0 1 2\n"),
        "a list of 4e.09 numbers is cut off",
    ),
    "lists of nothing.ply": (
        lambda: ply(claims(3, 500_000), TRIANGLE + b"0\n" * 500_000),
        "face 0 has 0 corners",
    ),
    "lists of nothing in binary.ply": (
        lambda: ply(claims(3, 500_000), bytes(36 + 500_000), LITTLE),
        "face 0 has 0 corners",
    ),
    "an endless list.ply": (
        lambda: ply(claims(3, 1), TRIANGLE + b"inf 0 1 2\n"),
        "a list of inf numbers is cut off",
    ),
    "no list at all.ply": (
        lambda: ply(claims(3, 1), TRIANGLE + b"nan 0 1 2\n"),
        "a list of nan numbers is cut off",
    ),
    "corners that are no numbers.ply": (
        lambda: ply(claims(3, 1), TRIANGLE + b"3 0 nan 2\n"),
        "a face names the vertex nan",
    ),
    "corners far away.ply": (
        lambda: ply(claims(3, 1), TRIANGLE + b"3 0 1e300 2\n"),
        r"a face names the vertex 1e\+300",
    ),
    "other columns than its header says.ply": (
        lambda: ply(claims(3), b"0 0 0 1\n" * 3),
        "it holds more than its header says",
    ),
    "more bytes than its header says.ply": (
        lambda: ply(claims(3), bytes(40), LITTLE),
        "it holds more than its header says",
    ),
    "words.ply": (lambda: ply(claims(3), b"zero zero zero\n"), "it holds what is no number"),
    "bytes as text.ply": (lambda: ply(claims(3), b"\xff\xfe" * 50), "it holds what is no number"),
    "a polygon that is cut off.ply": (
        lambda: ply(claims(3, 2), bytes(36) + FACE + b"\4" + bytes(15), LITTLE),
        "a list in row 1 has 4 entries",
    ),
    "a polygon that is not there.ply": (
        lambda: ply(claims(3, 3), bytes(36) + FACE + b"\4" + bytes(16), LITTLE),
        "'face' 2 is cut off",
    ),
    "a later list of 4 billion.ply": (
        lambda: ply(
            claims(3, 2).replace("uchar", "uint"),
            bytes(36) + b"\3\0\0\0" + bytes(12) + b"\xff" * 4 + bytes(16),
            LITTLE,
        ),
        "a list in row 1 has 4,294,967,295 entries",
    ),
    "a later list shorter than none.ply": (
        lambda: ply(
            claims(3, 2).replace("uchar", "int"),
            bytes(36) + b"\0\0\0\3" + bytes(12) + b"\xff" * 4 + bytes(16),
            BIG,
        ),
        "a list in row 1 has -1 entries",
    ),
    "a first list of no number.ply": (
        lambda: ply(
            claims(3, 1).replace("uchar", "float"), bytes(36) + b"\xff" * 4 + bytes(12), LITTLE
        ),
        "a list of nan numbers is cut off",
    ),
    "an endless first list.ply": (
        lambda: ply(
            claims(3, 1).replace("uchar", "float"), bytes(36) + b"\x7f\x80\0\0" + bytes(12), BIG
        ),
        "a list of inf numbers is cut off",
    ),
    "a later list of no number.ply": (
        lambda: ply(
            claims(3, 2).replace("uchar", "float"),
            bytes(36) + b"\0\0\x40\x40" + bytes(12) + b"\xff" * 4 + bytes(16),
            LITTLE,
        ),
        "a list in row 1 has nan entries",
    ),
    "polygons of nothing.ply": (
        lambda: ply(claims(3, 500_001), bytes(36) + FACE + bytes(500_000), LITTLE),
        "a list in row 1 has 0 entries",
    ),
    "a million lists that nobody reads.ply": (
        lambda: ply(
            "element strip 1000001\nproperty list uchar int places\n" + claims(3),
            b"\1" + bytes(4) + bytes(1_000_000),
            LITTLE,
        ),
        "says that it holds 3 times 'vertex', but is",
    ),
    "a polygon far away.ply": (
        lambda: ply(
            claims(3, 2), bytes(36) + FACE + b"\4" + bytes(12) + b"\xff\xff\xff\x7f", LITTLE
        ),
        "2147483647",
    ),
    "no z.ply": (
        lambda: ply(claims(3).replace("property float z", "property float w"), TRIANGLE),
        "its vertices have no z",
    ),
    "a property of nothing.ply": (lambda: ply("property float x"), "its header says 'property"),
    "a type that is none.ply": (
        lambda: ply("element vertex 1\nproperty text x"),
        "its header says 'property text x'",
    ),
    "numbers beyond their type.ply": (
        lambda: ply(claims(3, 1), b"1e300 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        "vertex 0 is .inf",
    ),
    "a long line in the header.ply": (
        lambda: b"ply\n" + b"x" * 10_000 + b"\nend_header\n",
        r"its header says 'xxx.*\.\.\.'",
    ),
    # .off
    "nothing.off": (lambda: b"", DAMAGED + "it does not begin with OFF"),
    "3 billion vertices.off": (
        lambda: b"OFF\n3000000000 1 0\n" + TRIANGLE,
        "claims to hold '3000000000' vertices",
    ),
    "more digits than numbers have.off": (
        lambda: b"OFF\n" + b"9" * 5000 + b" 1 0\n",
        r"claims to hold '999.*\.\.\.' vertices",
    ),
    "fewer than none.off": (lambda: b"OFF\n-3 1 0\n" + TRIANGLE, "claims to hold '-3' vertices"),
    "one vertex too many.off": (lambda: b"OFF\n4 0 0\n" + TRIANGLE, r"a position is \[\]"),
    "words.off": (lambda: b"OFF\n3 0 0\na b c\n", r"a position is \['a', 'b', 'c'\]"),
    "a face cut off.off": (
        lambda: b"OFF\n3 1 0\n" + TRIANGLE + b"4 0 1\n",
        r"face 0 is \['4', '0', '1'\]",
    ),
    "a face of billions.off": (
        lambda: b"OFF\n3 1 0\n" + TRIANGLE + b"4000000000 0 1 2\n",
        "face 0 is .'4000000000'",
    ),
    "a face of nothing.off": (lambda: b"OFF\n3 1 0\n" + TRIANGLE + b"0\n", "face 0 has 0 corners"),
    "a corner beyond all numbers.off": (
        lambda: b"OFF\n3 1 0\n" + TRIANGLE + b"3 0 1 99999999999999999999\n",
        "face 0 is",
    ),
    "a line without end.off": (
        lambda: b"OFF " + b"1 " * 2_000_000,
        "line 1 has more than 1,000,000 characters",
    ),
    # .stl
    "nothing.stl": (lambda: b"", "holds no vertices"),
    "4 billion triangles.stl": (
        lambda: bytes(80) + b"\xff" * 4 + bytes(50),
        "its header counts 4,294,967,295 triangles, which 134 bytes do not hold",
    ),
    "cut off.stl": (
        lambda: b"solid" + bytes(75) + struct.pack("<I", 2) + bytes(99),
        "holds no vertices",
    ),
    "words.stl": (
        lambda: b"solid a\nvertex a b c\nendsolid",
        "line 2: .vertex a b c.* is no vertex",
    ),
    "half a triangle.stl": (
        lambda: b"solid a\nvertex 0 0 0\nendsolid",
        "1 vertices are no triangles of three",
    ),
    "a line without end.stl": (
        lambda: b"solid " + b"x" * 2_000_000,
        "line 1 has more than 1,000,000 characters",
    ),
    "no end of a number.stl": (
        lambda: b"solid a\n" + b"vertex 0 0 1e999\n" * 3,
        "cannot use the mesh .* is .0.0, 0.0, inf",
    ),
    # .obj
    "nothing.obj": (lambda: b"", "holds no vertices"),
    "a line without end.obj": (
        lambda: b"v 0 0 0\nf" + b" 1" * 2_000_000,
        "line 2 has more than 1,000,000 characters",
    ),
    "a comment without end.obj": (lambda: b"#" * 3_000_000, "line 1 has more than 1,000,000"),
    "a corner of 5,000 digits.obj": (
        lambda: b"v 0 0 0\nf 1 1 " + b"9" * 5000,
        r"line 2: '999.*\.\.\.' is no corner",
    ),
    "a corner beyond all numbers.obj": (
        lambda: b"v 0 0 0\nf 1 1 99999999999999999999",
        "there is no vertex 99999999999999999999",
    ),
    "a long word.obj": (lambda: b"v " + b"x" * 900_000, r"line 1: 'xxx.*\.\.\.' is no position"),
    "half a face.obj": (lambda: b"v 0 0 0\nf", "line 2: a face"),
    "many far polygons.obj": (
        lambda: b"v 0 0 0\n" + (b"f" + b" 9" * 400_000 + b"\n") * 4,
        "face 0 is .8, 8, 8., but",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_meshes(meshes: Reader, tmp_path: Path, name: str) -> None:
    make, says = HOSTILE[name]
    (tmp_path / name).write_bytes(make())
    said = meshes.refusal(tmp_path / name)
    assert re.search(says, said), said


def binary(kind: str) -> bytes:
    """A square of one quad in binary, with a colour and a normal to be left in the file."""
    order = {LITTLE: "<", "binary_big_endian": ">"}[kind]
    header = (
        "comment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nelement face 1\n"
        "property list uchar int vertex_index\nproperty uchar flags"
    )
    rows = b"".join(struct.pack(f"{order}3fB", *vertex, 255) for vertex in VERTICES)
    return ply(header, rows + struct.pack(f"{order}B4iB", 4, 0, 1, 2, 3, 1), kind)


MIXED = (
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord"
)
SQUARE = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
DATA = (
    "data:application/octet-stream;base64,"
    + base64.b64encode(VERTICES.tobytes() + FACES.tobytes()).decode()
)
VALID: dict[str, Callable[[], bytes]] = {
    "plain.glb": square,
    "moved.glb": lambda: square(
        scenes=[{"nodes": [1]}],
        nodes=[{"mesh": 0, "translation": [-5, 0, 0]}, {"children": [0], "translation": [5, 0, 0]}],
    ),
    "in text.glb": lambda: square(buffers=[{"byteLength": 72, "uri": DATA}]),
    "a strip.glb": lambda: square(
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 6}]}],
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 4, "type": "SCALAR"},
        ],
        bufferViews=[
            {"buffer": 0, "byteLength": 48},
            {"buffer": 1, "byteLength": 16},
        ],
        buffers=[
            {"byteLength": 72},
            {
                "byteLength": 16,
                "uri": "data:;base64," + base64.b64encode(struct.pack("<4I", 0, 1, 2, 3)).decode(),
            },
        ],
    ),
    "little.ply": lambda: binary(LITTLE),
    "big.ply": lambda: binary("binary_big_endian"),
    "triangles.ply": lambda: ply(claims(4, 2), SQUARE + b"3 0 1 2\n3 0 2 3\n"),
    "a quad.ply": lambda: ply(claims(4, 1), SQUARE + b"4 0 1 2 3\n").replace(b"\n", b"\r\n"),
    "texture.ply": lambda: ply(MIXED, SQUARE + b"3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 1 1 .5 .5\n"),
    "normals.off": lambda: (
        b"NOFF\n4 2 0\n" + SQUARE.replace(b"\n", b" 0 0 1\n") + b"3 0 1 2\n3 0 2 3\n"
    ),
    "colours.off": lambda: (
        b"# made by hand\nCOFF 4 1 0\n"
        + SQUARE.replace(b"\n", b" 255 0 0 255\n")
        + b"\n4 0 1 2 3 0.5 0.5\n"
    ),
}


@pytest.mark.parametrize("name", VALID)
def test_a_square_in_many_forms(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(VALID[name]())
    mesh = read_mesh(tmp_path / name)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert mesh.faces.tolist() == FACES.tolist()


def test_triangles_and_polygons_of_one_file_keep_their_order(tmp_path: Path) -> None:
    mixed = SQUARE + b"3 0 1 2\n4 0 1 2 3\n3 0 2 3\n"
    (tmp_path / "mixed.ply").write_bytes(ply(claims(4, 3), mixed))
    (tmp_path / "mixed.off").write_bytes(b"OFF\n4 3 0\n" + mixed)
    for name in ("mixed.ply", "mixed.off"):
        faces = read_mesh(tmp_path / name).faces.tolist()
        assert faces == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 2, 3]]


def test_a_strip_turns_every_other_triangle(tmp_path: Path) -> None:
    strip = [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}]
    (tmp_path / "strip.glb").write_bytes(square(meshes=strip))
    assert read_mesh(tmp_path / "strip.glb").faces.tolist() == [[0, 1, 2], [2, 1, 3]]


def test_whole_numbers_may_stand_for_parts_of_one(tmp_path: Path) -> None:
    """KHR_mesh_quantization: of bytes, 255 stands for 1 m where they are normalized."""
    told = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5121, "count": 3, "type": "VEC3", "normalized": True}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 12, "byteStride": 4}],
        "buffers": [{"byteLength": 12}],
    }
    content = bytes([0, 0, 0, 9, 255, 0, 0, 9, 0, 255, 0, 9])
    (tmp_path / "small.glb").write_bytes(glb(told, content))
    vertices = read_mesh(tmp_path / "small.glb").vertices
    np.testing.assert_array_equal(vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_parts_of_points_and_of_lines(tmp_path: Path) -> None:
    """Points are vertices without triangles; lines are left in the file."""
    points = {"attributes": {"POSITION": 0}, "mode": 0}
    lines = {"attributes": {"POSITION": 0}, "mode": 1}
    (tmp_path / "points.glb").write_bytes(square(meshes=[{"primitives": [points, lines]}]))
    mesh = read_mesh(tmp_path / "points.glb", points_alone=True)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert mesh.faces.shape == (0, 3)


def test_an_stl_in_text(tmp_path: Path) -> None:
    corners = VERTICES[FACES].reshape(-1, 3)
    lines = [f"  Vertex {x:.1f} {y:.1e} {z}" for x, y, z in corners.tolist()]
    for solid in ("solid a", "solid b"):
        lines.append(f"end{solid}\n{solid}")
    (tmp_path / "a.stl").write_text("\n".join(["solid a", *lines]))
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.stl").vertices, corners)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".stl"])
def test_trimesh_reads_the_same(tmp_path: Path, suffix: str) -> None:
    """A library that draws meshes puts the same triangles in the same places."""
    import trimesh

    rng = np.random.default_rng(0)
    scene = trimesh.Scene()
    for name in ("a", "b"):
        part = trimesh.Trimesh(
            rng.normal(size=(9, 3)), rng.permutation(9).reshape(3, 3), process=False
        )
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
        turn[:3, 3] = rng.normal(size=3)
        scene.add_geometry(part, geom_name=name, transform=turn)
    path = tmp_path / f"scene{suffix}"
    if suffix == ".glb":
        scene.export(path)
    else:
        write_mesh(path, rng.normal(size=(9, 3)), rng.permutation(9).reshape(3, 3))
    theirs = trimesh.load_scene(path, process=False).to_mesh()
    ours = read_mesh(path)
    both = [
        np.array(sorted(mesh.vertices[mesh.faces].reshape(-1, 9).tolist()))
        for mesh in (ours, theirs)
    ]  # in any order of the parts
    np.testing.assert_allclose(*both, rtol=0, atol=1e-6)  # of single precision, turned once by each
    assert both[0].size > 0


def test_a_pipe_is_no_mesh(tmp_path: Path) -> None:
    """Opening one waits for somebody to write to it, perhaps for ever."""
    os.mkfifo(tmp_path / "pipe.ply")
    with pytest.raises(BadFile, match="there is no mesh file"):
        read_mesh(tmp_path / "pipe.ply")
