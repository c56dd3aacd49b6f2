"""glTF, read and written, and shown by other programs."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.clips_made_up import clip
from tests.motions.made_glb import NAMES, TRANS, made, places_of, turns, write_text
from tests.tiers import few
from workbench.errors import BadFile, UnknownName
from workbench.geometry import gltf
from workbench.geometry.gltf import document_of
from workbench.motions import read_glb, write_glb


@pytest.mark.parametrize("option", few([{"cubic": True}, {"floor": True}, {}, {"step": True}], 2))
def test_glb_of_other_programs_is_read(tmp_path: Path, option: dict[str, bool]) -> None:
    (tmp_path / "a.glb").write_bytes(made(**option))
    motion = wb.read_motion(tmp_path / "a.glb")
    assert motion.joint_names == NAMES
    assert motion.bones is not None
    assert motion.bones.parents == (-1, 0, 0)
    assert motion.fps == pytest.approx(10.0)
    np.testing.assert_allclose(motion.joints(), places_of(turns(), TRANS), atol=1e-4)
    relative = Rotation.from_rotvec(motion.pose[:, 1]).magnitude()
    np.testing.assert_allclose(relative, np.linalg.norm(turns()[:, 1], axis=1), atol=1e-3)
    assert "the unit is m" in motion.notes[0]
    assert "weights of morph targets are not read" in " ".join(motion.notes)
    assert ("left out at the root" in " ".join(motion.notes)) == ("floor" in option)


@pytest.mark.parametrize(
    "own",
    [{"rotation": [0.0, 1.0, 0.0, 0.0]}, {"scale": [0.0, 0.0, 0.0]}, {"translation": [1.0, 2, 3]}],
)
def test_transform_of_skinned_mesh_is_ignored(tmp_path: Path, own: dict[str, Any]) -> None:
    for name in ("plain", "moved"):
        write_text(tmp_path / f"{name}.gltf")
    document = json.loads((tmp_path / "moved.gltf").read_text())
    document["nodes"][5] |= own
    (tmp_path / "moved.gltf").write_text(json.dumps(document))
    plain, moved = (read_glb(tmp_path / f"{name}.gltf") for name in ("plain", "moved"))
    assert plain.bones is not None
    assert moved.bones is not None
    np.testing.assert_array_equal(moved.bones.rest, plain.bones.rest)
    np.testing.assert_array_equal(moved.pose, plain.pose)
    np.testing.assert_array_equal(moved.trans, plain.trans)


def test_joints_of_a_skin_may_have_any_order_and_several_trees(tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    write_text(path)
    plain = read_glb(path)
    document = json.loads(path.read_text())
    document["skins"] = [{"joints": [3, 4, 1]}]  # bound where the nodes are
    path.write_text(json.dumps(document))
    motion = read_glb(path)
    assert motion.joint_names == NAMES
    assert motion.bones is not None
    assert motion.bones.parents == (-1, 0, 0)
    np.testing.assert_allclose(motion.joints(), plain.joints(), atol=1e-5)
    document["nodes"][1]["children"].remove(4)
    path.write_text(json.dumps(document))
    motion = read_glb(path)
    assert motion.joint_names == ("hips", "spine")
    assert "joints in trees of their own are left out: leg" in motion.notes


def test_rotations_between_keys_go_the_shortest_way(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(made())
    motion, keys = read_glb(tmp_path / "a.glb", fps=20.0), read_glb(tmp_path / "a.glb")
    assert len(motion) == 7
    np.testing.assert_allclose(motion.pose[::2], keys.pose, atol=1e-6)
    np.testing.assert_allclose(motion.joints(), keys.resampled(20.0).joints(), atol=2e-4)


@pytest.mark.parametrize("name", ["small"])
def test_glb_survives_its_file(tmp_path: Path, name: str) -> None:
    body = wb.load_body(name)
    assert isinstance(body, wb.SkinnedBody)
    motion = clip(body, 7)
    write_glb(tmp_path / "a.glb", motion, body, correctives=2)
    read = wb.read_motion(tmp_path / "a.glb")
    assert read.fps == 30.0
    np.testing.assert_allclose(read.joints(), motion.joints(body), atol=1e-5)
    np.testing.assert_allclose(read.betas, motion.betas)
    np.testing.assert_allclose(read.vertices(body), motion.vertices(body), atol=1e-5)


def test_one_of_several_animations_is_read_by_name_or_number(tmp_path: Path) -> None:
    content = made()
    told = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    walk = told["animations"][0]
    rest = {"samplers": walk["samplers"], "channels": walk["channels"][3:4]}  # of the hips alone
    face = walk | {"name": "face", "channels": walk["channels"][4:]}
    (tmp_path / "a.glb").write_bytes(made({"animations": [walk, rest, face]}))
    (tmp_path / "b.glb").write_bytes(content)
    whole = read_glb(tmp_path / "b.glb")
    for name in (None, "walk", "0"):
        read = wb.read_motion(tmp_path / "a.glb", animation=name)
        np.testing.assert_array_equal(read.pose, whole.pose)
        np.testing.assert_array_equal(read.trans, whole.trans)
        assert "the animation walk is read, and not 1, face" in read.notes
    read = read_glb(tmp_path / "a.glb", animation="1")
    moved, way = (motion.trans - motion.trans[0] for motion in (read, whole))
    np.testing.assert_allclose(moved, way, atol=1e-9)
    assert np.abs(read.pose - read.pose[0]).max() < 1e-9
    with pytest.raises(UnknownName, match=r"'run'; there are walk \(0\), 1 \(1\), face \(2\)"):
        read_glb(tmp_path / "a.glb", animation="run")
    with pytest.raises(BadFile, match="an animation 'face', but not one of the joints of its skin"):
        read_glb(tmp_path / "a.glb", animation="face")


def test_damaged_glb_is_refused(tmp_path: Path) -> None:
    for change, said in [
        ({"skins": []}, "it has no skin with joints"),
        ({"animations": []}, "it has no animation of the joints of its skin"),
        ({"skins": [{"joints": [1, 1]}]}, r"skins\[0\] lists the same joint twice"),
        ({"skins": [{"joints": [1, 9]}]}, r"there is no nodes\[9\]"),
        ({"nodes": [{"children": [1]}, {"children": [0]}]}, "hang on each other in a circle"),
        (
            {
                "accessors": [{"componentType": 5126, "type": "SCALAR", "count": 2**40}],
                "skins": [{"joints": [1, 3, 4]}],
            },
            "holds 1,099,511,627,776 SCALAR and has no bytes",
        ),
        ({"accessors": []}, r"there is no accessors\[5\]"),
    ]:
        (tmp_path / "a.glb").write_bytes(made(change))
        with pytest.raises(
            BadFile, match=rf"a.glb is no motion as glTF \(.*{said}.*\); export a skin"
        ):
            read_glb(tmp_path / "a.glb")


def test_stretching_bones_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(made(stretched=10.0))
    with pytest.raises(BadFile, match="its bones change their length, so that joints are up to"):
        read_glb(tmp_path / "a.glb")


def test_gltf_text_is_the_same_motion(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(made())
    write_text(tmp_path / "b.gltf", name="some walk.bin")
    one, other = wb.read_motion(tmp_path / "a.glb"), wb.read_motion(tmp_path / "b.gltf")
    np.testing.assert_array_equal(one.pose, other.pose)
    np.testing.assert_array_equal(one.trans, other.trans)
    (tmp_path / "b.gltf").write_bytes(b"\xef\xbb\xbf\n" + (tmp_path / "b.gltf").read_bytes())
    np.testing.assert_array_equal(wb.read_motion(tmp_path / "b.gltf").pose, one.pose)


@pytest.mark.parametrize(
    ("buffer", "said"),
    [
        ({"uri": "/etc/passwd"}, "only files in the folder of the .gltf, or below it"),
        ({"uri": "%2Fetc%2Fpasswd"}, "only files in the folder"),
        ({"uri": "../walk.bin"}, "only files in the folder"),
        ({"uri": "a/%2e%2e/%2e%2e/walk.bin"}, "only files in the folder"),
        ({"uri": "file:///etc/passwd"}, "only files in the folder"),
        ({"uri": "http://127.0.0.1:1/walk.bin"}, "only files in the folder"),
        ({"uri": "C:\\walk.bin"}, "only files in the folder"),
        ({"uri": 5}, "said to be in 5, and only files"),
        ({"uri": "nobody.bin"}, "which is not in the folder; keep both together"),
        ({"uri": "link.bin"}, "which leads out of the file's folder"),
        ({"uri": "endless.bin"}, "which is not in the folder"),
        (
            {"uri": "short.bin", "byteLength": 10**6},
            "has 1,000,000 bytes, and its file 'short.bin'",
        ),
    ],
)
def test_gltf_text_opens_no_other_file(tmp_path: Path, buffer: dict[str, Any], said: str) -> None:
    (tmp_path / "walk.bin").write_bytes(bytes(4096))
    folder = tmp_path / "inside"
    folder.mkdir()
    (folder / "link.bin").symlink_to(tmp_path / "walk.bin")
    (folder / "short.bin").write_bytes(bytes(8))
    os.mkfifo(folder / "endless.bin")
    write_text(folder / "a.gltf", {"buffers": [{"byteLength": 1} | buffer, {"byteLength": 0}]})
    with pytest.raises(BadFile, match=re.escape(said)):
        read_glb(folder / "a.gltf")


def test_file_of_many_buffers_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf, "MOST_BYTES", 5000)
    (tmp_path / "twice.bin").write_bytes(bytes(4096))
    (tmp_path / "more.bin").write_bytes(bytes(1000))
    many = [{"byteLength": 4096, "uri": "twice.bin"}] * 1000
    write_text(tmp_path / "a.gltf", {"buffers": many})
    assert (
        len({id(b) for b in document_of((tmp_path / "a.gltf").read_bytes(), tmp_path).buffers}) == 1
    )
    write_text(tmp_path / "a.gltf", {"buffers": [*many, {"byteLength": 1, "uri": "more.bin"}]})
    with pytest.raises(BadFile, match="it has more than 904 bytes"):
        read_glb(tmp_path / "a.gltf")


def test_other_gltf_versions_are_refused(tmp_path: Path) -> None:
    for version in ["1.0", 2, None]:
        write_text(tmp_path / "a.gltf", {"asset": {"version": version}})
        with pytest.raises(BadFile, match=r"and glTF 2\.0 is read"):
            read_glb(tmp_path / "a.gltf")


MODULES = os.environ.get("WORKBENCH_NODE_MODULES", "")
NEEDS_NODE = pytest.mark.skipif(
    shutil.which("node") is None or not (Path(MODULES or "none") / "three").is_dir(),
    reason="no node on the PATH, or WORKBENCH_NODE_MODULES names no folder with gltf-validator "
    "and three, which `npm install gltf-validator three` makes",
)


def shown(path: Path) -> tuple[dict[str, object], np.ndarray]:
    """What the validator finds, and the vertices (T * N, 3) m that three.js shows."""
    script, out = Path(__file__).with_name("three.mjs"), path.with_suffix(".bin")
    command = ["node", str(script), str(Path(MODULES).absolute()), str(path), str(out)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return json.loads(run.stdout), np.fromfile(out).reshape(-1, 3)


@pytest.mark.thorough
@NEEDS_NODE
@pytest.mark.parametrize(
    ("name", "frames", "correctives", "farthest"),
    [
        ("small", 12, None, 1e-6),
        ("default", 40, 32, 5e-4),
    ],
)
def test_validator_and_three_show_the_body(
    tmp_path: Path, name: str, frames: int, correctives: int | None, farthest: float
) -> None:
    """The validator finds nothing, and three.js shows the body, to within `farthest` in m."""
    body, path = wb.load_body(name), tmp_path / "a.glb"
    assert isinstance(body, wb.SkinnedBody)
    motion = clip(body, frames, seed=6)
    write_glb(path, motion, body, correctives=correctives, shapes=10)
    issues, places = shown(path)
    counts = [issues[f"num{kind}"] for kind in ("Errors", "Warnings", "Infos", "Hints")]
    assert counts == [0, 0, 0, 0], issues["messages"]
    off = np.linalg.norm(places - motion.vertices(body).reshape(-1, 3), axis=1)
    assert off.max() < farthest
