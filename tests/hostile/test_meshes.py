"""Mesh and scan files made to hang, to fill the memory or to read other files: each is refused."""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.geometry.mesh_files import (
    CORNERS,
    LITTLE,
    PART,
    POSITIONS,
    claims,
    glb,
    ply,
    positions,
    square,
)
from tests.hostile.formats import cloud
from tests.hostile.limits import Reader

MESH, SCAN = "workbench.geometry.meshes:read_mesh", "workbench.fitting.scans.files:read_scan"
TRIANGLE = b"0 0 0\n1 0 0\n0 1 0\n"
MANY = 3_000_000_000
FLOATS = claims(3, 1).replace("uchar", "float")
TREE = [*({"children": [i + 1] * 2} for i in range(60)), {"mesh": 0}]
FAR = {"mesh": 0, "scale": [1e308] * 3, "rotation": [0.5] * 4, "translation": [1e308] * 3}
THOUSANDS = {
    "meshes": [{"primitives": [PART] * 20_000}],
    "scenes": [{"nodes": list(range(20_000))}],
    "nodes": [{"mesh": 0}] * 20_000,
}

GLB: dict[str, Callable[[], bytes]] = {
    "an older version": lambda: b"glTF" + struct.pack("<II", 1, 12),
    "a part of 4 GB": lambda: b"glTF" + struct.pack("<III", 2, 99, 2**32 - 1) + b"JSON{}",
    "lists in lists": lambda: glb(b"[" * 400_000),
    "6 million lists": lambda: glb(b"[" + b"[]," * 6_000_000 + b"0]"),
    "entries of one name": lambda: glb(b'{"nodes": [], "nodes": 5}'),
    "3 billion numbers": lambda: positions(count=MANY),
    "numbers of no bytes": lambda: positions(count=MANY, bufferView=None),
    "nodes in a circle": lambda: square(nodes=[{"children": [1]}, {"children": [0]}]),
    "nodes twice on every level": lambda: square(nodes=TREE),
    "an endless place": lambda: square(nodes=[FAR]),
    "parts times nodes": lambda: square(**THOUSANDS),
    "corners of no vertex": lambda: square(accessors=[POSITIONS | {"count": 2}, CORNERS]),
}
PLY: dict[str, Callable[[], bytes]] = {
    "no end of its header": lambda: b"ply\n" + b"comment x\n" * 100_000,
    "3 billion vertices": lambda: ply(claims(MANY), TRIANGLE),
    "more than its header says": lambda: ply(claims(3), bytes(40), LITTLE),
    "a list of no number": lambda: ply(FLOATS, bytes(36) + b"\xff" * 4 + bytes(12), LITTLE),
    "many empty lines": lambda: ply(claims(3), TRIANGLE + b"\n" * 20_000_000),
    "many edges": lambda: ply(
        "element edge 200000\nproperty int vertex1\nproperty int vertex2\n" + claims(3),
        bytes(1_600_000 + 36 + 1),
        LITTLE,
    ),
    "lists of nothing": lambda: ply(claims(3, 500_000), bytes(36 + 500_000), LITTLE),
    "a corner far away": lambda: ply(claims(3, 1), TRIANGLE + b"3 0 1e300 2\n"),
    "numbers beyond their type": lambda: ply(
        claims(3, 1), TRIANGLE.replace(b"1", b"1e300") + b"3 0 1 2\n"
    ),
    "a long line in the header": lambda: b"ply\n" + b"x" * 10_000 + b"\nend_header\n",
}
LINES: dict[str, Callable[[], bytes]] = {
    "one vertex too many.off": lambda: b"OFF\n4 0 0\n" + TRIANGLE,
    "a face too few.off": lambda: b"OFF\n3 2 0\n" + TRIANGLE + b"3 0 1 2\n",
    "many solids.stl": lambda: (b"solid a\n" + b"vertex 0 0 1\n" * 3 + b"endsolid a\n") * 20_000,
    "4 billion triangles.stl": lambda: bytes(80) + b"\xff" * 4 + bytes(50),
    "no end of a number.stl": lambda: b"solid a\n" + b"vertex 0 0 1e999\n" * 3,
    "a comment without end.obj": lambda: b"#" * 3_000_000,
    "a corner beyond all numbers.obj": lambda: b"v 0 0 0\nf 1 1 99999999999999999999",
}
COUNT = b"COUNT 1 1 1"
UNPACKED = b"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nPOINTS 178956970\nDATA binary_compressed\n"
CLOUDS: dict[str, Callable[[], bytes]] = {
    "an endless header.pcd": lambda: b"# pcd\n" * 100_000,
    "points beyond the file.pcd": lambda: cloud("binary").replace(b"369", b"%d" % 10**14),
    "lines beyond the file.pcd": lambda: cloud("ascii").replace(b"369", b"%d" % 10**14),
    "a histogram.pcd": lambda: cloud("binary").replace(COUNT, b"COUNT 1 1 %d" % 10**14),
    "unpacked it is 4 GB.pcd": lambda: (
        UNPACKED + struct.pack("<II", 300_000, 2**32 - 16) + b"\xe0\xff\x00" * 100_000
    ),
    "one endless line.xyz": lambda: b"1 " * 3_000_000,
    "a word among numbers.xyz": lambda: b"1 2 3\n" * 200 + b"1 two 3\n",
    "numbers beyond all.xyz": lambda: b"1e999 -1e999 1\n" * 200,
}


def refused(reader: Reader, read: str, folder: Path, name: str, content: bytes) -> str:
    (folder / name).write_bytes(content)
    return reader.refusal(read, folder / name)


@pytest.mark.parametrize("suffix", ["glb", "ply", "off, stl and obj"])
def test_hostile_meshes_are_refused(reader: Reader, tmp_path: Path, suffix: str) -> None:
    files = {"glb": GLB, "ply": PLY}.get(suffix, LINES)
    for name, make in files.items():
        file = name if "." in name else f"{name}.{suffix}"
        refused(reader, MESH, tmp_path, file, make())


def test_hostile_scans_are_refused(reader: Reader, tmp_path: Path) -> None:
    for name, make in CLOUDS.items():
        refused(reader, SCAN, tmp_path, name, make())


def test_glb_opens_no_other_file(reader: Reader, tmp_path: Path) -> None:
    for address in ("/etc/passwd", "http://127.0.0.1:1/a", "../secret.bin", 5):
        content = square(buffers=[{"byteLength": 72, "uri": address}])
        said = refused(reader, MESH, tmp_path, "other.glb", content)
        assert "in another file" in said
        assert "not opened" in said
