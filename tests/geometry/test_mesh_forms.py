"""Other forms of mesh files: what other programs write is read as the same triangles."""

import base64
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.geometry.mesh_files import (
    BIG,
    CORNERS,
    FACES,
    LITTLE,
    PART,
    POSITIONS,
    VERTICES,
    claims,
    glb,
    ply,
    square,
)
from workbench.geometry.meshes import read_mesh, write_mesh


def binary(kind: str) -> bytes:
    """A square of one quad in binary, with a colour and a normal to be left in the file."""
    order = {LITTLE: "<", BIG: ">"}[kind]
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
FAN = "data:;base64," + base64.b64encode(struct.pack("<4I", 0, 1, 2, 3)).decode()
VALID: dict[str, Callable[[], bytes]] = {
    "plain.glb": square,
    "moved.glb": lambda: square(
        scenes=[{"nodes": [1]}],
        nodes=[{"mesh": 0, "translation": [-5, 0, 0]}, {"children": [0], "translation": [5, 0, 0]}],
    ),
    "in text.glb": lambda: square(buffers=[{"byteLength": 72, "uri": DATA}]),
    "a strip.glb": lambda: square(
        meshes=[{"primitives": [PART | {"mode": 6}]}],
        accessors=[POSITIONS, CORNERS | {"count": 4}],
        bufferViews=[{"buffer": 0, "byteLength": 48}, {"buffer": 1, "byteLength": 16}],
        buffers=[{"byteLength": 72}, {"byteLength": 16, "uri": FAN}],
    ),
    "little.ply": lambda: binary(LITTLE),
    "big.ply": lambda: binary(BIG),
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
def test_square_is_read_in_every_form(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(VALID[name]())
    mesh = read_mesh(tmp_path / name)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert mesh.faces.tolist() == FACES.tolist()


def test_triangles_and_polygons_keep_their_order(tmp_path: Path) -> None:
    mixed = SQUARE + b"3 0 1 2\n4 0 1 2 3\n3 0 2 3\n"
    (tmp_path / "mixed.ply").write_bytes(ply(claims(4, 3), mixed))
    (tmp_path / "mixed.off").write_bytes(b"OFF\n4 3 0\n" + mixed)
    for name in ("mixed.ply", "mixed.off"):
        faces = read_mesh(tmp_path / name).faces.tolist()
        assert faces == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 2, 3]]


def test_glb_strip_turns_every_other_triangle(tmp_path: Path) -> None:
    strip = [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}]
    (tmp_path / "strip.glb").write_bytes(square(meshes=strip))
    assert read_mesh(tmp_path / "strip.glb").faces.tolist() == [[0, 1, 2], [2, 1, 3]]


def test_glb_normalized_bytes_are_parts_of_one(tmp_path: Path) -> None:
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


def test_glb_points_are_vertices_without_triangles(tmp_path: Path) -> None:
    """Points are vertices without triangles; lines are left in the file."""
    points = {"attributes": {"POSITION": 0}, "mode": 0}
    lines = {"attributes": {"POSITION": 0}, "mode": 1}
    (tmp_path / "points.glb").write_bytes(square(meshes=[{"primitives": [points, lines]}]))
    mesh = read_mesh(tmp_path / "points.glb", points_alone=True)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert mesh.faces.shape == (0, 3)


def test_stl_in_text_is_read(tmp_path: Path) -> None:
    corners = VERTICES[FACES].reshape(-1, 3)
    lines = [f"  Vertex {x:.1f} {y:.1e} {z}" for x, y, z in corners.tolist()]
    for solid in ("solid a", "solid b"):
        lines.append(f"end{solid}\n{solid}")
    (tmp_path / "a.stl").write_text("\n".join(["solid a", *lines]))
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.stl").vertices, corners)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".stl"])
def test_read_mesh_agrees_with_trimesh(tmp_path: Path, suffix: str) -> None:
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
