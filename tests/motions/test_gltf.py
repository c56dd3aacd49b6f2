"""Motions from .glb files: our own, and one that is put together here as other programs do."""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from benchmarks.clips_made_up import clip
from tests.motions.made_glb import NAMES, TRANS, made, places_of, turns, write_text
from tests.tiers import few
from workbench.errors import BadFile
from workbench.geometry import gltf
from workbench.geometry.gltf import GlbDocument, document_of
from workbench.motions import read_glb, write_glb
from workbench.motions.gltf import Track


@pytest.mark.parametrize("option", few([{"cubic": True}, {"floor": True}, {}, {"step": True}], 2))
def test_glb_of_other_programs_is_read(tmp_path: Path, option: dict[str, bool]) -> None:
    (tmp_path / "a.glb").write_bytes(made(**option))
    found = wb.read_motion(tmp_path / "a.glb")
    assert found.joint_names == NAMES
    assert found.bones is not None
    assert found.bones.parents == (-1, 0, 0)
    assert found.fps == pytest.approx(10.0)
    np.testing.assert_allclose(found.joints(), places_of(turns(), TRANS), atol=1e-4)
    relative = Rotation.from_rotvec(found.pose[:, 1]).magnitude()
    np.testing.assert_allclose(relative, np.linalg.norm(turns()[:, 1], axis=1), atol=1e-3)
    assert "the unit is m" in found.notes[0]
    assert "weights of morph targets are not read" in " ".join(found.notes)
    assert ("left out at the root" in " ".join(found.notes)) == ("floor" in option)


def test_rotations_between_keys_go_the_shortest_way(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(made())
    found, keys = read_glb(tmp_path / "a.glb", fps=20.0), read_glb(tmp_path / "a.glb")
    assert len(found) == 7
    np.testing.assert_allclose(found.pose[::2], keys.pose, atol=1e-6)
    np.testing.assert_allclose(found.joints(), keys.resampled(20.0).joints(), atol=2e-4)


@pytest.mark.parametrize("name", ["small"])
def test_glb_survives_its_file(tmp_path: Path, name: str) -> None:
    body = wb.load_body(name)
    assert isinstance(body, wb.SkinnedBody)
    motion = clip(body, 7)
    write_glb(tmp_path / "a.glb", motion, body, correctives=2)
    found = wb.read_motion(tmp_path / "a.glb")
    assert found.fps == 30.0
    np.testing.assert_allclose(found.joints(), motion.joints(body), atol=1e-5)
    np.testing.assert_allclose(found.betas, motion.betas)
    np.testing.assert_allclose(found.vertices(body), motion.vertices(body), atol=1e-5)


def test_damaged_glb_is_refused(tmp_path: Path) -> None:
    for change, said in [
        ({"skins": []}, "it has no skin with joints"),
        ({"animations": []}, "it has no animation of the joints of its skin"),
        ({"skins": [{"joints": [1, 1]}]}, "a skin lists the same joint twice"),
        ({"skins": [{"joints": [1, 9]}]}, r"there is no nodes\[9\]"),
        ({"nodes": [{"children": [1]}, {"children": [0]}]}, "hang on each other in a circle"),
        (
            {
                "accessors": [{"componentType": 5126, "type": "SCALAR", "count": 2**40}],
                "skins": [{"joints": [1, 3, 4]}],
            },
            "holds 1,099,511,627,776 SCALAR, all of them zero",
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


def test_unit_and_axis_of_glb_can_be_given(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(made())
    plain = read_glb(tmp_path / "a.glb").joints()
    found = read_glb(tmp_path / "a.glb", unit="cm", up="z").joints()
    np.testing.assert_allclose(found, 0.01 * plain[..., [0, 2, 1]] * [1, 1, -1], atol=1e-9)


def test_normalized_integers_are_shares() -> None:
    content = np.array([0, 51, 255], "<u1").tobytes() + np.array([-128, -127, 127], "<i1").tobytes()
    views = [{"buffer": 0, "byteOffset": at, "byteLength": 3} for at in (0, 3)]
    several = [
        {"bufferView": v, "componentType": code, "type": "SCALAR", "count": 3, "normalized": True}
        for v, code in ((0, 5121), (1, 5120))
    ]
    told = {"accessors": several, "bufferViews": views, "buffers": [{"byteLength": 6}]}
    document = GlbDocument(told, [content])
    np.testing.assert_allclose(document.values(0, "SCALAR", 1).ravel(), [0, 0.2, 1])
    np.testing.assert_allclose(document.values(1, "SCALAR", 1).ravel(), [-1, -1, 1])


def test_cubic_tracks_are_exact_for_cubics() -> None:
    """x(t) = t^3 - t on [0, 2] is a cubic, so that one piece with its slopes at both ends is it."""
    times, values = np.array([0.0, 2.0]), np.zeros((2, 3, 3))
    values[:, 1, 0] = [0.0, 6.0]
    values[0, 2, 0], values[1, 0, 0] = -1.0, 11.0  # the slopes after the first and before the last
    at = np.array([0.0, 0.5, 1.0, 1.7, 2.0, 3.0])
    inside = np.minimum(at, 2.0)
    found = Track(times, values, "CUBICSPLINE", turns=False).at(at)
    np.testing.assert_allclose(found[:, 0], inside**3 - inside, atol=1e-12)


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
