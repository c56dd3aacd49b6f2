"""Mesh files: what is written is read, in its order."""

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.tiers import few
from workbench.errors import BadFile, BadMesh
from workbench.geometry.meshes import read_mesh, write_mesh

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
    ("suffix", "tolerance"), [(".obj", 0), (".ply", 0), (".off", 0), (".glb", 2e-7)]
)
def test_written_mesh_is_read_in_its_order(tmp_path: Path, suffix: str, tolerance: float) -> None:
    path = tmp_path / f"mesh{suffix}"
    write_mesh(path, VERTICES, FACES)
    mesh = read_mesh(path)
    np.testing.assert_allclose(mesh.vertices, VERTICES, rtol=tolerance, atol=tolerance)
    np.testing.assert_array_equal(mesh.faces, FACES)
    assert list(tmp_path.iterdir()) == [path]


def test_stl_keeps_its_triangles(tmp_path: Path) -> None:
    write_mesh(tmp_path / "mesh.stl", VERTICES, FACES)
    mesh = read_mesh(tmp_path / "mesh.stl")
    np.testing.assert_allclose(mesh.vertices[mesh.faces], VERTICES[FACES], rtol=2e-7, atol=2e-7)


def test_obj_with_seams_keeps_its_vertices(tmp_path: Path) -> None:
    (tmp_path / "seams.obj").write_text(SEAMS)
    mesh = read_mesh(tmp_path / "seams.obj")
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert mesh.faces.tolist() == [[2, 1, 0], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 1, 2]]


def test_parts_of_a_scene_are_placed(tmp_path: Path) -> None:
    import trimesh

    part = trimesh.Trimesh(VERTICES, FACES, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(part, geom_name="a")
    scene.add_geometry(part.copy(), geom_name="b", transform=np.diag([2.0, 2, 2, 1]))
    scene.export(tmp_path / "scene.glb")
    mesh = read_mesh(tmp_path / "scene.glb")
    np.testing.assert_allclose(mesh.vertices, np.vstack([VERTICES, 2 * VERTICES]), atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, np.vstack([FACES, FACES + len(VERTICES)]))


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
CUT = [
    [0, 1, 2],
    [0, 2, 3],
    [0, 3, 4],
    [1, 2, 5],
    [7, 6, 5],
    [7, 5, 4],
    [7, 4, 3],
    [2, 3, 6],
    [2, 6, 7],
]


def polygons_ply(order: str, polygons: list[list[int]], *, texture: bool = False) -> bytes:
    """A .ply of polygons; with texture, each has a flag before and coordinates behind its corners.

    Also a normal list of its own length, which nothing reads, before the corners.
    """
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "=": "ascii"}[order]
    head = f"ply\nformat {kind} 1.0\nelement vertex 8\nproperty double x\nproperty double y\n"
    head += f"property double z\nelement face {len(polygons)}\n"
    head += "property uchar flag\nproperty list ushort short odd\n" if texture else ""
    head += "property list uchar int vertex_indices\n"
    head += "property list uchar float texcoord\n" if texture else ""
    rows: list[list[tuple[str, float]]] = [[("d", x) for x in v] for v in VERTICES]
    for i, polygon in enumerate(polygons):
        row: list[tuple[str, float]] = [("B", i), ("H", i % 3), *(("h", -i) for _ in range(i % 3))]
        corners = [("B", len(polygon)), *(("i", c) for c in polygon)]
        behind = [("B", 2 * len(polygon)), *(("f", 0.5) for _ in range(2 * len(polygon)))]
        rows.append([*row, *corners, *behind] if texture else corners)
    head += "end_header\n"
    if order == "=":
        return (
            head + "\n".join(" ".join(f"{float(x)!r}" for _, x in row) for row in rows)
        ).encode()
    return head.encode() + b"".join(struct.pack(order + c, x) for row in rows for c, x in row)


@pytest.mark.parametrize("texture", [False, True])
@pytest.mark.parametrize("order", few(["<", ">", "="], 1))
def test_polygons_are_cut_into_triangles(tmp_path: Path, order: str, texture: bool) -> None:
    path = tmp_path / "polygons.ply"
    path.write_bytes(polygons_ply(order, POLYGONS, texture=texture))
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    assert mesh.faces.tolist() == CUT


@pytest.mark.thorough
@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_polygons_are_those_of_the_text(tmp_path: Path, order: str) -> None:
    """Also where the first thousand are alike, and where all are."""
    rng = np.random.default_rng(0)
    for sizes in (np.full(1200, 4), rng.integers(3, 9, 1200), np.r_[np.full(1199, 3), 5]):
        polygons = [rng.permutation(8)[:n].tolist() for n in sizes]
        found = []
        for kind in (order, "="):
            (tmp_path / "mesh.ply").write_bytes(polygons_ply(kind, polygons))
            found.append(read_mesh(tmp_path / "mesh.ply"))
        np.testing.assert_array_equal(found[0].faces, found[1].faces)
        assert len(found[0].faces) == np.sum(sizes - 2)


def test_damaged_meshes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="no mesh file"):
        read_mesh(tmp_path / "missing.obj")
    for name, content, says in (
        ("empty.obj", "", "holds no vertices"),
        ("empty.ply", "", "damaged, or no .ply file"),
        ("empty.glb", "", "damaged, or no .glb file"),
        ("empty.stl", "", "holds no vertices"),
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
