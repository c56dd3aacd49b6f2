"""Skinned glTF: read back and evaluated as a viewer would, it says what the body says."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import workbench as wb
from workbench.bodies.files.correctives import correctives_of
from workbench.bodies.files.gltf import write_gltf
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument, BadBody

SMALL = wb.load_body("small")
TYPES: dict[int, type[np.generic]] = {
    5126: np.float32,
    5125: np.uint32,
    5123: np.uint16,
    5121: np.uint8,
}
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def some() -> tuple[np.ndarray, np.ndarray]:
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


def test_a_viewer_shows_the_body(tmp_path: Path) -> None:
    poses, betas = some()
    write_gltf(tmp_path / "a.glb", SMALL, poses, betas)
    document, array = read(tmp_path / "a.glb")
    for frame, pose in enumerate(poses):
        shown = skinned(document, array, frame)
        np.testing.assert_allclose(shown, SMALL.vertices(pose, betas), atol=1e-6)
    bare = SMALL.vertices(0 * poses[0], betas)
    assert abs(bare - SMALL.vertices(poses[0], betas)).max() > 0.1
    names = [node["name"] for node in document["nodes"]]
    assert names[:-1] == list(SMALL.joint_names)


@pytest.mark.parametrize("count", [0, 1, 2, None])
def test_fewer_correctives_are_off_by_what_the_file_says(tmp_path: Path, count: int | None) -> None:
    poses, betas = some()
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
    assert extras["betas"] == betas.tolist()


def test_correctives_are_the_best_of_their_number() -> None:
    """No other two directions leave less, in the sum of squares: Eckart and Young."""
    poses, betas = np.random.default_rng(3).normal(scale=0.3, size=(6, 24, 3)), np.zeros(10)
    added = np.array([SMALL.posedirs @ SMALL.kinematics.motion(p, betas).features for p in poses])
    flat = added.reshape(6, -1)
    sizes = np.linalg.svd(flat, compute_uv=False)
    for count in (1, 2, 5):
        found = correctives_of(SMALL, poses, betas, count)
        left = flat - found.shares @ found.shapes.reshape(count, -1)
        assert (left**2).sum() == pytest.approx((sizes[count:] ** 2).sum(), rel=1e-6)
        assert abs(found.shares).max() == pytest.approx(1.0)


def test_shape_directions_and_normals_are_in_the_file(tmp_path: Path) -> None:
    poses, betas = some()
    write_gltf(tmp_path / "a.glb", SMALL, poses, betas, shapes=2, correctives=1)
    document, array = read(tmp_path / "a.glb")
    mesh = document["meshes"][0]
    assert mesh["extras"]["targetNames"] == ["betas[0]", "betas[1]", "pose corrective 0"]
    targets = mesh["primitives"][0]["targets"]
    for b in range(2):
        moved = array(targets[b]["POSITION"])
        np.testing.assert_allclose(moved, SMALL.shapedirs[:, :, b], atol=1e-7)
    normals = array(mesh["primitives"][0]["attributes"]["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    rest = trimesh.Trimesh(SMALL.vertices(betas=betas), SMALL.faces, process=False)
    assert np.median((normals * rest.vertex_normals).sum(axis=1)) > 0.95
    with pytest.raises(BadArgument, match="10 shape directions; as morph targets, give 0 to"):
        write_gltf(tmp_path / "b.glb", SMALL, poses, shapes=11)
    with pytest.raises(BadArgument, match="number of correctives is a whole number from 0"):
        write_gltf(tmp_path / "b.glb", SMALL, poses, correctives=-1)


def test_the_root_travels(tmp_path: Path) -> None:
    poses, betas = some()
    trans = np.array([[0.0, 1, 0], [0.1, 1, 0.5], [0.2, 1.1, 1.0]])
    write_gltf(tmp_path / "a.glb", SMALL, poses, betas, trans=trans)
    document, array = read(tmp_path / "a.glb")
    for frame, (pose, place) in enumerate(zip(poses, trans, strict=True)):
        shown = skinned(document, array, frame)
        np.testing.assert_allclose(shown, SMALL.vertices(pose, betas, place), atol=1e-6)


def test_quaternions_of_neighbouring_frames_are_on_one_side(tmp_path: Path) -> None:
    """A full turn in ten frames: rotation vectors of at most pi jump to the other side."""
    poses = np.zeros((11, 24, 3))
    turn = np.linspace(0, 2 * np.pi, 11)
    poses[:, 3, 1] = np.where(turn > np.pi, turn - 2 * np.pi, turn)
    write_gltf(tmp_path / "a.glb", SMALL, poses)
    document, array = read(tmp_path / "a.glb")
    for sampler in document["animations"][0]["samplers"][:24]:
        q = array(sampler["output"])
        assert ((q[1:] * q[:-1]).sum(axis=1) > 0.9).all()


@pytest.mark.parametrize("make", [scape, blend_scape])
def test_bones_and_correctives_show_a_triangle_body(
    tmp_path: Path, make: Callable[[wb.SkinnedBody], TriangleBody]
) -> None:
    """Also where a twist by half a turn flattens what linear blending makes of a forearm."""
    assert isinstance(SMALL, wb.SkinnedBody)
    body, (poses, betas) = make(SMALL), some()
    poses[1, body.joint_names.index("left_wrist")] = [np.pi, 0, 0]
    trans = np.array([[0.0, 1, 0], [0.1, 1, 0.5], [0.2, 1.1, 1.0]])
    found = write_gltf(tmp_path / "a.glb", body, poses, betas, trans=trans, shapes=2)
    assert len(found.shapes) == 3
    assert found.largest < 1e-7
    document, array = read(tmp_path / "a.glb")
    for frame, (pose, place) in enumerate(zip(poses, trans, strict=True)):
        shown = skinned(document, array, frame)
        np.testing.assert_allclose(shown, body.vertices(pose, betas, place), atol=1e-6)
    assert "WEIGHTS_1" not in document["meshes"][0]["primitives"][0]["attributes"]
    moved = array(document["meshes"][0]["primitives"][0]["targets"][1]["POSITION"])
    direction = body.vertices(betas=np.eye(10)[1]) - body.vertices()
    np.testing.assert_allclose(moved, direction, atol=1e-7)
    few = write_gltf(tmp_path / "b.glb", body, poses, betas, correctives=1)
    assert 1e-3 < few.mean < few.largest


def test_trimesh_opens_it(tmp_path: Path) -> None:
    poses, betas = some()
    write_gltf(tmp_path / "a.glb", SMALL, poses, betas)
    (mesh,) = trimesh.load_scene(tmp_path / "a.glb", process=False).geometry.values()
    np.testing.assert_allclose(mesh.vertices, SMALL.vertices(betas=betas), atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, SMALL.faces)


def test_what_no_gltf_can_say_is_refused_and_nothing_written(tmp_path: Path) -> None:
    poses, _ = some()
    twisted = replace(SMALL, skinning=wb.dual_quaternion_blend)
    with pytest.raises(BadBody, match="is not skinned as a glTF is"):
        write_gltf(tmp_path / "a.glb", twisted, poses)
    assert not list(tmp_path.iterdir())
