"""Mesh files: what is written is read, in its order."""

import base64
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.geometry.mesh_files import (
    BIG,
    CORNERS,
    LITTLE,
    PART,
    POSITIONS,
    SKINNED,
    claims,
    glb,
    ply,
    skinned,
    square,
)
from tests.geometry.mesh_files import FACES as TWO
from tests.geometry.mesh_files import VERTICES as SQUARE_PLACES
from tests.tiers import few
from workbench.errors import BadFile, BadMesh
from workbench.fitting.scans.files import contents_of
from workbench.geometry.meshes import Mesh, read_mesh, same_faces, write_mesh

VERTICES = np.random.default_rng(0).normal(size=(8, 3))
VERTICES[5] = VERTICES[2]  # twins, which must not be merged; vertex 7 is in no face
FACES = np.array([[4, 1, 2], [0, 3, 5], [6, 1, 0], [2, 1, 4]])

SEAMS = """# one quad of two materials; texture and normals change at a shared edge
mtllib missing.mtl
v 0 0 0 0.5 0.5 0.5
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
o one
usemtl red
f 3/1/1 2/2/1 1/1/1
g two
usemtl blue
f 1//1 3//1 4//1
f 1 2 3 4
f -4 -3 -2
"""


@pytest.mark.parametrize(
    ("suffix", "tolerance"), [(".obj", 0), (".ply", 0), (".off", 0), (".glb", 2e-7), (".stl", 2e-7)]
)
def test_written_mesh_is_read_in_its_order(tmp_path: Path, suffix: str, tolerance: float) -> None:
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, VERTICES, FACES)
    mesh = read_mesh(path)
    triangles = mesh.vertices[mesh.faces]
    np.testing.assert_allclose(triangles, VERTICES[FACES], rtol=tolerance, atol=tolerance)
    assert list(tmp_path.iterdir()) == [path]
    if suffix != ".stl":  # which shares no vertices
        np.testing.assert_allclose(mesh.vertices, VERTICES, rtol=tolerance, atol=tolerance)
        np.testing.assert_array_equal(mesh.faces, FACES)


def test_obj_with_seams_keeps_its_vertices(tmp_path: Path) -> None:
    (tmp_path / "seams.obj").write_text(SEAMS)
    mesh = read_mesh(tmp_path / "seams.obj")
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert mesh.faces.tolist() == [[2, 1, 0], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 1, 2]]


@pytest.mark.parametrize("corner", ["1/--1", "1/x", "1/9"])
def test_unusable_texture_coordinates_are_left_in_the_file(tmp_path: Path, corner: str) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf {corner} 2/1 3/1\n")
    mesh = read_mesh(path)
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.uv is None


def textured() -> Mesh:
    """Two triangles of a square, on an own place of the texture each."""
    places = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    uv = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.25], [0.75, 0.25], [1.0, 0.75], [0.75, 1.0]])
    return Mesh(places, np.array([[0, 1, 2], [0, 2, 3]]), uv, np.array([[0, 1, 2], [3, 4, 5]]))


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_texture_coordinates_are_written_and_read(tmp_path: Path, suffix: str) -> None:
    mesh, path = textured(), tmp_path / f"mesh{suffix}"
    write_mesh(path, mesh)
    again = read_mesh(path)
    assert again.uv is not None
    assert again.uv_faces is not None
    assert mesh.uv is not None
    np.testing.assert_array_equal(again.vertices[:4], mesh.vertices)
    np.testing.assert_array_equal(again.vertices[again.faces], mesh.vertices[mesh.faces])
    np.testing.assert_array_equal(again.uv[again.uv_faces], mesh.uv[mesh.uv_faces])
    if suffix == ".obj":
        np.testing.assert_array_equal(again.faces, mesh.faces)
        np.testing.assert_array_equal(again.uv, mesh.uv)
    else:  # vertices 0 and 2 are on the seam
        np.testing.assert_array_equal(again.vertices[4:], mesh.vertices[[0, 2]])
        shown = trimesh.load(path, force="mesh", process=False)  # an independent reader
        np.testing.assert_allclose(shown.visual.uv[shown.faces], mesh.uv[mesh.uv_faces])
    write_mesh(tmp_path / "again.obj", again)
    np.testing.assert_array_equal(read_mesh(tmp_path / "again.obj").vertices, again.vertices)


@pytest.mark.parametrize("suffix", few([".ply", ".obj", ".off"], 1))
def test_points_alone_are_read_when_asked_for(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"points{suffix}"
    write_mesh(path, VERTICES, [])
    with pytest.raises(BadFile, match=r"8 points and no faces.*points_alone"):
        read_mesh(path)
    cloud = read_mesh(path, points_alone=True)
    np.testing.assert_array_equal(cloud.vertices, VERTICES)
    assert cloud.faces.shape == (0, 3)


POLYGONS = [[0, 1, 2], [0, 2, 3, 4], [1, 2, 5], [7, 6, 5, 4, 3], [2, 3, 6, 7]]


@pytest.mark.parametrize(
    ("suffix", "sizes"), [(".ply", 4), (".ply", 5), (".obj", 0), (".off", 0), (".ply", 0)]
)
def test_polygons_are_fans_of_triangles(tmp_path: Path, suffix: str, sizes: int) -> None:
    """In the file's order, but in text of different polygons, where triangles may come first."""
    polygons = [(np.arange(sizes) + i) % 8 for i in range(7)] if sizes else POLYGONS
    rows = "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons)
    places = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in VERTICES.tolist())
    head = claims(8, len(polygons)).replace("float", "double")
    content = {
        ".ply": ply(head, (places + rows).encode()),
        ".off": f"OFF\n8 {len(polygons)} 0\n{places}{rows}".encode(),
        ".obj": b"".join(
            [f"v {line}\n".encode() for line in places.splitlines()]
            + [f"f {' '.join(str(k + 1) for k in p)}\n".encode() for p in polygons]
        ),
    }
    (tmp_path / f"a{suffix}").write_bytes(content[suffix])
    mesh = read_mesh(tmp_path / f"a{suffix}")
    fans = np.array([[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)])
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert same_faces(mesh.faces, fans)
    if sizes:
        np.testing.assert_array_equal(mesh.faces, fans)


def test_binary_ply_of_different_polygons_is_read(tmp_path: Path) -> None:
    """In the file's order, as Blender writes quads and triangles; cut off it is refused."""
    rows = b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) for p in POLYGONS)
    head = claims(8, 5).replace("float", "double")
    content = ply(head, VERTICES.astype("<f8").tobytes() + rows, LITTLE)
    (tmp_path / "a.ply").write_bytes(content)
    mesh = read_mesh(tmp_path / "a.ply")
    fans = [[p[0], p[k], p[k + 1]] for p in POLYGONS for k in range(1, len(p) - 1)]
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    np.testing.assert_array_equal(mesh.faces, fans)
    for end in range(0, len(content), 5):
        (tmp_path / "a.ply").write_bytes(content[:end])
        with pytest.raises(BadFile):
            read_mesh(tmp_path / "a.ply")


@pytest.mark.parametrize("suffix", [".off", ".ply", ".stl"])
def test_cut_off_meshes_are_refused(tmp_path: Path, suffix: str) -> None:
    """Wherever they are cut, within a number of the last line of a text excepted."""
    path = tmp_path / f"a{suffix}"
    write_mesh(path, VERTICES, FACES)
    content = path.read_bytes()
    for end in range(0, len(content) - 2, 3):
        path.write_bytes(content[:end])
        with pytest.raises(BadFile):
            read_mesh(path, points_alone=True)


def test_trimesh_is_taken_and_given(tmp_path: Path) -> None:
    """With twins, a vertex in no face and all orders as they are."""
    given = trimesh.Trimesh(VERTICES, FACES, process=False, validate=False)
    write_mesh(tmp_path / "a.ply", given)
    mesh = read_mesh(tmp_path / "a.ply")
    write_mesh(tmp_path / "b.ply", mesh)
    assert (tmp_path / "b.ply").read_bytes() == (tmp_path / "a.ply").read_bytes()
    for one in (mesh.trimesh(), Mesh.of(given), Mesh.of(mesh), Mesh.of(VERTICES, FACES)):
        np.testing.assert_array_equal(one.vertices, VERTICES)
        np.testing.assert_array_equal(one.faces, FACES)
    for wrong in (VERTICES, "a.ply", trimesh.PointCloud(VERTICES)):
        with pytest.raises(BadMesh, match="is no mesh; give"):
            Mesh.of(wrong)


def test_damaged_meshes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="no mesh file"):
        read_mesh(tmp_path / "missing.obj")
    for name, content, says in (
        ("empty.obj", "", "holds no vertices"),
        ("empty.ply", "", "damaged, or no .ply file"),
        ("empty.glb", "", "damaged, or no .glb file"),
        ("empty.stl", "", "damaged, or no .stl file"),
        ("prose.off", "not a mesh", "damaged, or no .off file"),
        ("mesh.txt", "v 0 0 0", "no mesh format is called"),
        ("nan.obj", "v 0 0 0\nv 0 nan 0\nv 1 0 0\nf 1 2 3", "nan"),
        ("far.obj", "v 0 0 0\nv 0 1 0\nf 1 2 3", "but there are 2 vertices"),
        ("zero.obj", "v 0 0 0\nf 0 1 1", "counted from 1"),
        ("torn.obj", "v 0 0 0\nv 0 1", "no position"),
        ("words.obj", "v 0 0 0\nf a b c", "no corner"),
    ):
        (tmp_path / name).write_text(content)
        with pytest.raises(BadFile, match=says):
            read_mesh(tmp_path / name)


def test_unwritable_meshes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="no mesh format is called"):
        write_mesh(tmp_path / "mesh.fbx", VERTICES, FACES)
    with pytest.raises(BadFile, match=r"holds triangles; write points as \.ply"):
        write_mesh(tmp_path / "mesh.stl", VERTICES, [])
    with pytest.raises(BadFile, match="choose an existing folder"):
        write_mesh(tmp_path / "no" / "mesh.obj", VERTICES, FACES)
    with pytest.raises(BadMesh, match="vertex 0 is"):
        write_mesh(tmp_path / "mesh.ply", np.full((3, 3), np.nan), [[0, 1, 2]])
    with pytest.raises(BadMesh, match="no vertices"):
        write_mesh(tmp_path / "mesh.ply", np.zeros((0, 3)), [])
    assert not list(tmp_path.iterdir())


# What other programs write.


def binary(kind: str) -> bytes:
    """A square of one quad in binary, with a colour and a normal to be left in the file."""
    order = {LITTLE: "<", BIG: ">"}[kind]
    header = (
        "comment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nelement face 1\n"
        "property list uchar int vertex_index\nproperty uchar flags"
    )
    rows = b"".join(struct.pack(f"{order}3fB", *vertex, 255) for vertex in SQUARE_PLACES)
    return ply(header, rows + struct.pack(f"{order}B4iB", 4, 0, 1, 2, 3, 1), kind)


SQUARE = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
DATA = (
    "data:application/octet-stream;base64,"
    + base64.b64encode(SQUARE_PLACES.tobytes() + TWO.tobytes()).decode()
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
    "comments.ply": lambda: ply(claims(4, 2), SQUARE + b"3 0 1 2\n3 0 2 3\n").replace(
        b"format", b"comment gr\xf6\xdfe\nformat"
    ),
    "triangles.ply": lambda: ply(claims(4, 2), SQUARE + b"3 0 1 2\n3 0 2 3\n"),
    "a quad.ply": lambda: ply(claims(4, 1), SQUARE + b"4 0 1 2 3\n").replace(b"\n", b"\r\n"),
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
    np.testing.assert_array_equal(mesh.vertices, SQUARE_PLACES)
    assert same_faces(mesh.faces, TWO.astype(np.int64))


def test_glb_accessors_may_be_bytes_or_sparse_but_not_compressed(tmp_path: Path) -> None:
    """Of normalized bytes, 255 stands for 1 m (KHR_mesh_quantization)."""
    told = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "bufferViews": [{"buffer": 0, "byteLength": 12, "byteStride": 4}]
        + [{"buffer": 0, "byteOffset": at, "byteLength": 12} for at in (12, 24)],
        "buffers": [{"byteLength": 36}],
    }
    content = bytes([0, 0, 0, 9, 255, 0, 0, 9, 0, 255, 0, 9, 1, 2])
    content = content.ljust(24, b"\0") + bytes([255, 0, 0, 0, 255, 0]).ljust(12, b"\0")
    kind = {"componentType": 5121, "count": 3, "type": "VEC3", "normalized": True}
    sparse = {"count": 2, "indices": {"bufferView": 1, "componentType": 5121}}
    for accessor in (
        {"bufferView": 0},
        {"sparse": {**sparse, "values": {"bufferView": 2}}},  # all others are zero
    ):
        (tmp_path / "a.glb").write_bytes(glb({**told, "accessors": [kind | accessor]}, content))
        vertices = read_mesh(tmp_path / "a.glb").vertices
        np.testing.assert_array_equal(vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    (tmp_path / "a.glb").write_bytes(glb({**told, "accessors": [kind]}, content))
    with pytest.raises(BadFile, match="has no bytes for them; of a file that is compressed"):
        read_mesh(tmp_path / "a.glb")


def test_skins_pose_a_mesh_and_its_own_node_does_not_count(tmp_path: Path) -> None:
    """As in three.js's Xbot, whose mesh is read 0.018 m long where its node's scale counts."""
    content, exact = skinned()
    (tmp_path / "a.glb").write_bytes(content)
    np.testing.assert_allclose(read_mesh(tmp_path / "a.glb").vertices, exact, atol=1e-6)
    np.testing.assert_allclose(contents_of(tmp_path / "a.glb", None).points, exact, atol=1e-6)
    lines = {"attributes": {"POSITION": 0, "JOINTS_0": 1}, "mode": 1}  # which are left out
    (tmp_path / "b.glb").write_bytes(
        skinned(meshes=[{"primitives": [SKINNED | {"indices": 4}, lines]}])[0]
    )
    np.testing.assert_array_equal(
        read_mesh(tmp_path / "b.glb").vertices, read_mesh(tmp_path / "a.glb").vertices
    )
    for change, said in [
        ({"skins": [{"joints": []}]}, r"skins\[0\] has no joints"),
        ({"skins": [{"joints": [1, 9]}]}, "one that its scene does not show"),
        ({"skins": [{"joints": [1, 1]}]}, "the same joint twice"),
        ({"skins": [{"joints": [1]}]}, "a joint beyond the 1 of its skin"),
        ({"skins": [{"joints": [1, 2, 3], "inverseBindMatrices": 5}]}, "3 joints, 2 bind matrices"),
        ({"skins": []}, r"there is no skins\[0\]"),
        ({"meshes": [{"primitives": [PART | {"indices": 4}]}]}, "its vertices follow no joints"),
        ({"skins": [{}]}, r"skins\[0\] has no joints"),
    ]:
        (tmp_path / "a.glb").write_bytes(skinned(**change)[0])
        with pytest.raises(BadFile, match=said):
            read_mesh(tmp_path / "a.glb")
