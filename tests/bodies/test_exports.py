"""Bodies for other programs: a glTF shows, and written C code computes, what the body says."""

import ctypes
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.bodies.laws import some_arguments
from tests.bodies_made_up import tube_body
from tests.tiers import few
from workbench.bodies.files.c_code import write_c
from workbench.bodies.files.gltf import write_gltf
from workbench.bodies.triangles import scape
from workbench.errors import BadArgument, BadBody
from workbench.geometry.meshes import read_mesh, write_mesh

SMALL = wb.load_body("small")
TYPES: dict[int, type[np.generic]] = {
    5126: np.float32,
    5125: np.uint32,
    5123: np.uint16,
    5121: np.uint8,
}
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TRANS = np.array([[0.0, 1, 0], [0.1, 1, 0.5], [0.2, 1.1, 1.0]])


def some_poses() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rng.normal(scale=0.4, size=(3, 24, 3)), rng.normal(size=10)


def read(path: Path) -> tuple[dict[str, Any], Any]:
    raw = path.read_bytes()
    assert raw[:4] == b"glTF"
    assert int.from_bytes(raw[8:12], "little") == len(raw)
    size = int.from_bytes(raw[12:16], "little")
    document, binary = json.loads(raw[20 : 20 + size]), raw[28 + size :]

    def array(i: int) -> np.ndarray:
        a = document["accessors"][i]
        view = document["bufferViews"][a["bufferView"]]
        count = a["count"] * WIDTH[a["type"]]
        flat = np.frombuffer(binary, TYPES[a["componentType"]], count, view["byteOffset"])
        rows = flat.astype(float).reshape(a["count"], -1)
        np.testing.assert_array_equal(rows.min(axis=0), np.array(a["min"], dtype=float))
        return rows

    return document, array


def skinned(document: dict[str, Any], array: Any, frame: int) -> np.ndarray:
    """What the standard says a viewer shows at a key frame."""
    mesh, skin = document["meshes"][0]["primitives"][0], document["skins"][0]
    turn, weights, root = {}, np.zeros(0), None
    for channel in document["animations"][0]["channels"]:
        out = array(document["animations"][0]["samplers"][channel["sampler"]]["output"])
        if channel["target"]["path"] == "weights":
            weights = out.reshape(-1, len(mesh["targets"]))[frame]
        elif channel["target"]["path"] == "translation":
            assert channel["target"]["node"] == 0
            root = out[frame]
        else:
            turn[channel["target"]["node"]] = Rotation.from_quat(out[frame]).as_matrix()
    V = array(mesh["attributes"]["POSITION"])
    for weight, target in zip(weights, mesh.get("targets", ()), strict=True):
        V = V + weight * array(target["POSITION"])
    world: dict[int, np.ndarray] = {}

    def walk(node: int, above: np.ndarray) -> None:
        here = np.eye(4)
        here[:3, :3], here[:3, 3] = turn[node], document["nodes"][node]["translation"]
        if node == 0 and root is not None:
            here[:3, 3] = root
        world[node] = above @ here
        for child in document["nodes"][node].get("children", ()):
            walk(child, world[node])

    walk(skin["skeleton"], np.eye(4))
    inverse = array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    M = np.stack([world[j] @ b for j, b in zip(skin["joints"], inverse, strict=True)])
    blend, s = np.zeros((len(V), 4, 4)), 0
    while f"JOINTS_{s}" in mesh["attributes"]:
        joints = array(mesh["attributes"][f"JOINTS_{s}"]).astype(int)
        blend += np.einsum("ni,niab->nab", array(mesh["attributes"][f"WEIGHTS_{s}"]), M[joints])
        s += 1
    moved = np.einsum("nab,nb->na", blend, np.column_stack([V, np.ones(len(V))]))
    return np.asarray(moved[:, :3])


# glTF.


def test_viewers_of_gltf_show_the_body(tmp_path: Path) -> None:
    poses, betas = some_poses()
    for trans in (TRANS[2], TRANS):  # one place for all key frames, or as many
        write_gltf(tmp_path / "a.glb", SMALL, poses, betas, trans=trans)
        document, array = read(tmp_path / "a.glb")
        expected = SMALL.vertices(poses, betas, trans)
        for frame, vertices in enumerate(expected):
            np.testing.assert_allclose(skinned(document, array, frame), vertices, atol=1e-6)
    names = [node["name"] for node in document["nodes"]]
    assert names[:-1] == list(SMALL.joint_names)
    (mesh,) = trimesh.load_scene(tmp_path / "a.glb", process=False).geometry.values()
    np.testing.assert_allclose(mesh.vertices, SMALL.vertices(betas=betas), atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, SMALL.faces)


@pytest.mark.parametrize("count", few([1, None, 0, 2], 2))
def test_error_of_few_correctives_is_said(tmp_path: Path, count: int | None) -> None:
    poses, betas = some_poses()
    found = write_gltf(tmp_path / "a.glb", SMALL, poses, betas, correctives=count)
    document, array = read(tmp_path / "a.glb")
    off = np.array(
        [
            np.linalg.norm(skinned(document, array, t) - SMALL.vertices(pose, betas), axis=1)
            for t, pose in enumerate(poses)
        ]
    )
    assert found.mean == pytest.approx(off.mean(), abs=5e-7)
    assert found.largest == pytest.approx(off.max(), abs=2e-6)
    assert (found.mean > 1e-4) == (count is not None)
    extras = document["asset"]["extras"]
    assert extras["correctives"] == len(found.shapes) == (3 if count is None else count)
    assert (extras["mean_error_m"], extras["largest_error_m"]) == (found.mean, found.largest)


def test_texture_of_a_body_goes_where_the_body_goes(tmp_path: Path) -> None:
    """Two places of the texture for each vertex: every second face takes the other one."""
    N, corners = SMALL.n_vertices, SMALL.faces.copy()
    corners[1::2] += N
    uv = np.random.default_rng(0).uniform(size=(2 * N, 2))
    body = replace(SMALL, extras={"vt": uv, "ft": corners.astype(np.uint32)})
    for name in ("body.npz", "body.pkl"):
        wb.save_body(body, tmp_path / name)
        found = wb.load_body(tmp_path / name).texture
        np.testing.assert_array_equal(found[0], uv)
        np.testing.assert_array_equal(found[1], corners)
    poses, betas = some_poses()
    write_mesh(tmp_path / "body.obj", body.mesh(poses[0], betas))
    mesh = read_mesh(tmp_path / "body.obj")
    np.testing.assert_array_equal(mesh.vertices, body.vertices(poses[0], betas))
    assert mesh.uv is not None
    np.testing.assert_array_equal(mesh.uv[mesh.uv_faces], uv[corners])
    write_gltf(tmp_path / "body.glb", body, poses, betas, shapes=1)
    at_rest = read_mesh(tmp_path / "body.glb")
    assert at_rest.uv is not None
    np.testing.assert_allclose(at_rest.uv[at_rest.uv_faces], uv[corners], atol=1e-6)
    rest = body.template + body.shapedirs @ betas
    np.testing.assert_allclose(at_rest.vertices[at_rest.faces], rest[body.faces], atol=1e-6)
    document, _ = read(tmp_path / "body.glb")
    primitive = document["meshes"][0]["primitives"][0]
    numbers = [*primitive["attributes"].values(), primitive["targets"][0]["POSITION"]]
    assert {document["accessors"][i]["count"] for i in numbers} == {len(at_rest.vertices)}
    assert replace(body, extras={"vt": uv, "ft": corners[1:]}).texture == (None, None)
    assert SMALL.texture == (None, None)


def test_quaternions_of_neighbouring_frames_are_on_one_side(tmp_path: Path) -> None:
    """A full turn in ten frames: rotation vectors of at most pi jump to the other side."""
    poses, turn = np.zeros((11, 24, 3)), np.linspace(0, 2 * np.pi, 11)
    poses[:, 3, 1] = np.where(turn > np.pi, turn - 2 * np.pi, turn)
    write_gltf(tmp_path / "a.glb", SMALL, poses)
    document, array = read(tmp_path / "a.glb")
    for sampler in document["animations"][0]["samplers"][:24]:
        q = array(sampler["output"])
        assert ((q[1:] * q[:-1]).sum(axis=1) > 0.9).all()


def test_gltf_refuses_what_it_cannot_show(tmp_path: Path) -> None:
    poses, betas = some_poses()
    for body in (replace(SMALL, skinning=wb.dual_quaternion_blend), scape(tube_body())):
        with pytest.raises(BadBody, match=r"not skinned as a glTF is.*write_mesh"):
            write_gltf(tmp_path / "a.glb", body, poses)  # type: ignore[arg-type]
    with pytest.raises(BadBody, match="has no faces"):
        write_gltf(tmp_path / "a.glb", replace(SMALL, faces=SMALL.faces[:0]), poses)
    refused: dict[str, dict[str, Any]] = {
        "whole number from 0 to 10": {"shapes": 11},
        "from 0, or None": {"correctives": -1},
        r"trans \(4, 3\) do not fit": {"trans": np.zeros((4, 3))},
        "up to 10 betas": {"betas": np.zeros(11)},
        r"one person, whose betas are \(B,\)": {"betas": np.zeros((3, 10))},
        r"24 joints .*not \(3, 23, 3\)": {"poses": poses[:, :23]},
        "no poses": {"poses": poses[:0]},
        "shape .3, 10.": {"moving": np.zeros((2, 10))},
        "moving must be finite": {"poses": np.where(poses > 0.5, np.nan, poses)},
        "must be positive": {"seconds": 0.0},
    }
    for said, other in refused.items():
        arguments = {"poses": poses, "betas": betas} | other
        with pytest.raises((BadBody, BadArgument), match=said):
            write_gltf(tmp_path / "b.glb", SMALL, **arguments)
    assert not list(tmp_path.iterdir())


# C code.

COMPILER = shutil.which("cc") or shutil.which("gcc")
DOUBLES = ctypes.POINTER(ctypes.c_double)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler on the PATH")
@pytest.mark.parametrize(
    ("name", "points"),
    [("small", "joints"), pytest.param("hand", "tips", marks=pytest.mark.thorough)],
)
def test_written_c_code_gives_points_of_the_body(tmp_path: Path, name: str, points: str) -> None:
    body, path, library = wb.load_body(name), tmp_path / "code.c", tmp_path / "code.so"
    write_c(path, body, points)
    command = [str(COMPILER), "-shared", "-fPIC", "-O0", str(path), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, timeout=600)
    code = ctypes.CDLL(str(library))
    sizes = [ctypes.c_longlong() for _ in range(4)]
    getattr(code, f"{points}_work")(*(ctypes.byref(size) for size in sizes))
    given = some_arguments(body, scale=0.3)
    found = np.empty((len(body.landmark_names(points)), 3))
    integers, reals = (np.zeros(max(1, size.value)) for size in sizes[2:])
    arg = (DOUBLES * max(3, sizes[0].value))(*(a.ctypes.data_as(DOUBLES) for a in given))
    res = (DOUBLES * max(1, sizes[1].value))(found.ctypes.data_as(DOUBLES))
    done = getattr(code, points)(
        arg, res, integers.ctypes.data_as(ctypes.c_void_p), reals.ctypes.data_as(DOUBLES), 0
    )
    assert done == 0
    np.testing.assert_allclose(found, body.landmark(points, *given), atol=1e-12)
