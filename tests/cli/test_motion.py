"""`workbench motion`, `convert` and `body code`: what files hold, and the same in other formats."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.clips_made_up import clip
from tests.conversion.made_skeletons import KINDS, write_skeleton
from tests.motions.made_files import MARKER_FILES, MOTION_FILES
from tests.motions.made_results import RESULTS, truth
from workbench.fitting import read_markers
from workbench.motions import Trajectories, write_trc

FILES = MOTION_FILES | MARKER_FILES


def test_motion_says_what_a_file_holds(tmp_path: Path, workbench: Run) -> None:
    for name, said in (
        ("walk.bvh", "a motion of 6 frames at 30 frames a second, 0.17 s"),
        ("amass.npz", "52 joints: pelvis, left_hip"),
        ("walk.glb", "a motion of 4 frames at 10 frames a second, 0.30 s"),
        ("floats.c3d", "8 markers in 6 frames at 100 frames a second"),
        ("walk.trc", "labels: LFHD, RFHD, C7, STRN, LANK and 3 more"),
        ("markers.npz", "the unit is taken to be mm"),
    ):
        FILES[name](tmp_path / name)
        code, out, _ = workbench("motion", name)
        assert code == 0
        assert said in out
        assert out.startswith(f"{name} holds ")


def test_motion_writes_bvh_and_reads_it_back(tmp_path: Path, workbench: Run) -> None:
    FILES["motion.npz"](tmp_path / "motion.npz")
    options = "--out", "walk.bvh", "--fps", "120", "--body", "small"
    code, out, _ = workbench("motion", "motion.npz", *options)
    assert code == 0
    assert "resampled to 11 frames at 120 frames a second" in out
    code, out, _ = workbench("motion", "walk.bvh", "--out", "again.npz", "--fps", "60")
    assert code == 0
    body = wb.load_body("small")
    before, after = wb.read_motion(tmp_path / "motion.npz"), wb.read_motion(tmp_path / "again.npz")
    order = [after.joint_names.index(name) for name in body.joint_names]
    np.testing.assert_allclose(after.joints()[:, order], before.joints(body), atol=1e-6)


@pytest.mark.thorough
def test_motion_writes_glb(tmp_path: Path, workbench: Run) -> None:
    FILES["motion.npz"](tmp_path / "motion.npz")
    code, out, _ = workbench("motion", "motion.npz", "--out", "walk.glb", "--body", "small")
    assert code == 0
    assert "motion: walk.glb" in out
    assert (tmp_path / "walk.glb").read_bytes().startswith(b"glTF")
    code, _, wrong = workbench("motion", "motion.npz", "--out", "a.glb", "--body", "small-scape")
    assert code == 2
    assert "is made of a SkinnedBody" in wrong
    assert not (tmp_path / "a.glb").exists()


def test_motion_takes_one_person_and_writes_layouts(tmp_path: Path, workbench: Run) -> None:
    make = RESULTS["InterGen"][1]
    make(tmp_path / "two.pkl", truth())
    code, out, _ = workbench("motion", "two.pkl", "--person", "person2", "--out", "a.smpl")
    assert code == 0
    assert "of 2 people (person1, person2) person2 is read, 12 frames, as was asked" in out
    assert wb.read_motion(tmp_path / "a.smpl").gender == "female"
    arguments = ("--layout", "smplx", "--out", "b.npz")
    assert workbench("motion", "two.pkl", "--person", "person1", *arguments)[0] == 0
    with np.load(tmp_path / "b.npz") as arrays:
        assert arrays["global_orient"].shape == (12, 3)
    for wrong, said in (
        (("--person", "person3"), "it holds no person 'person3'; there are person1, person2"),
        (("--layout", "mhr", "--out", "c.npz"), "there is no layout 'mhr'; there are amass, smplx"),
        (("--dmpls", "model.npz"), "--dmpls moves the --body of an SMPL file"),
    ):
        code, _, told = workbench("motion", "two.pkl", *wrong)
        assert code == 2
        assert said in " ".join(told.split())


def test_motion_writes_markers(tmp_path: Path, workbench: Run) -> None:
    FILES["walk.trc"](tmp_path / "walk.trc")
    code, out, _ = workbench("motion", "walk.trc", "--out", "walk.npz", "--fps", "10")
    assert code == 0
    assert "--fps changes nothing: walk.trc holds markers" in out
    there = read_markers(tmp_path / "walk.npz").markers
    np.testing.assert_allclose(there, read_markers(tmp_path / "walk.trc").markers, atol=1e-12)


def test_motion_refuses_what_it_cannot_read_or_write(tmp_path: Path, workbench: Run) -> None:
    FILES["walk.bvh"](tmp_path / "walk.bvh")
    FILES["floats.c3d"](tmp_path / "walk.c3d")
    FILES["walk.glb"](tmp_path / "walk.glb")
    (tmp_path / "walk.npz").write_bytes(b"PK nothing")
    for arguments, said in (
        ("walk.fbx", "a motion is a file that ends in .bvh, .glb"),
        ("walk.bvh --fps 0", "--fps takes a number above 0, not 0"),
        ("walk.bvh --out walk.c3d", "can be written as .bvh or .npz or .glb or .smpl, and not as"),
        ("walk.c3d --out walk.bvh", "markers can be written as .npz or .trc, and not as"),
        ("walk.bvh --unit ell", "no unit is called 'ell'"),
        ("walk.bvh --up w", "no axis is called 'w'"),
        ("walk.npz", "walk.npz is no file of a motion or of markers"),
        ("walk.bvh --body small", "of the motion (Hips, Left Leg"),
        (
            "walk.bvh --animation 0",
            "an animation is one of a .glb or .gltf, and walk.bvh is neither",
        ),
        ("walk.glb --animation run", "no animation is called 'run'; there are walk (0)"),
    ):
        code, _, wrong = workbench("motion", *arguments.split())
        assert code == 2
        assert said in " ".join(wrong.split())


@cache
def small() -> wb.SkinnedBody:
    return wb.load_body("small")


def points() -> tuple[str, ...]:
    return tuple(small().landmark_names("coco"))


def motion_file(folder: Path, frames: int = 3) -> wb.Motion:
    motion = clip(small(), frames)
    wb.save_motion(folder / "walk.npz", motion)
    return motion


def test_convert_moves_a_motion_to_a_body(tmp_path: Path, workbench: Run) -> None:
    motion = motion_file(tmp_path)
    arguments = "walk.npz", "--from", "small", "--to", "small", "--out", "other.npz"
    code, out, _ = workbench("convert", *arguments)
    assert code == 0
    assert "the same triangles: 369 vertices correspond one to one" in out
    assert "left_forearm" in out
    assert "vertices are 0.0" in out
    found = wb.read_motion(tmp_path / "other.npz")
    off = np.linalg.norm(found.vertices(small()) - motion.vertices(small()), axis=2)
    assert 1e3 * off.mean() < 0.1


def test_convert_fits_a_body_to_named_points(tmp_path: Path, workbench: Run) -> None:
    motion = clip(small(), 3)
    places = 1e3 * motion.landmark(small(), "coco")
    write_trc(tmp_path / "points.trc", Trajectories(places, points(), 30.0, "mm"))
    arguments = "points.trc", "--to", "small", "--out", "found.bvh", "--from", "default"
    code, out, _ = workbench("convert", *arguments)
    assert code == 0
    assert "--from changes nothing: points.trc holds points" in out
    assert "23 of 23 points are coco of body 'small'" in out
    assert "mm from those of the body on average" in out
    assert len(wb.read_motion(tmp_path / "found.bvh")) == 3


def test_convert_fits_a_body_to_a_skeleton(tmp_path: Path, workbench: Run) -> None:
    body, kind = wb.load_body("default-male"), KINDS["LAFAN1"]
    write_skeleton(tmp_path / "walk.bvh", clip(body, 3, seed=6), body, kind)
    code, out, _ = workbench("convert", "walk.bvh", "--to", "small")
    assert code == 0
    assert "22 of 22 points are joints of body 'small' by the names of LAFAN1" in out
    assert any(line.split()[:2] == ["left_knee", "LeftLeg"] for line in out.splitlines())
    assert len(wb.read_motion(tmp_path / "walk-small.npz")) == 3
    text, lines = (tmp_path / "walk.bvh").read_text(), ["name;joint"]
    for k, (name, _, joint) in enumerate(kind.tree()):
        text = text.replace(f" {name}\n", f" Bone{k:02}\n")
        lines += [f"Bone{k:02};{joint}"] * ("spine" not in joint)
    (tmp_path / "walk.bvh").write_text(text)
    (tmp_path / "names.csv").write_text("\n".join(lines))
    code, _, wrong = workbench("convert", "walk.bvh", "--to", "small")
    assert code == 2
    assert "a table of names says which are which (--names)" in " ".join(wrong.split())
    code, out, _ = workbench("convert", "walk.bvh", "--to", "small", "--names", "names.csv")
    assert code == 0
    assert "19 of 22 points are joints of body 'small'" in out
    (mean,) = [line for line in out.splitlines() if line.startswith("joints are ")]
    assert float(mean.split()[2]) < 10


@pytest.mark.thorough
def test_motion_says_the_error_of_correctives(tmp_path: Path, workbench: Run) -> None:
    motion_file(tmp_path)
    for correctives, count in (("1", 1), ("exact", 3), ("0", 0)):
        options = "--body", "small", "--out", "walk.glb", "--correctives", correctives
        code, out, _ = workbench("motion", "walk.npz", *options, "--shapes", "10")
        assert code == 0
        assert f"10 shape directions, {count} correctives: vertices are off by" in out
        raw = (tmp_path / "walk.glb").read_bytes()
        document = json.loads(raw[20 : 20 + int.from_bytes(raw[12:16], "little")])
        assert document["asset"]["extras"]["correctives"] == count


def test_body_code_writes_a_function(tmp_path: Path, workbench: Run) -> None:
    code, out, _ = workbench("body", "code", "hand", "--points", "tips", "--out", "tips.c")
    assert code == 0
    assert "code: tips.c" in out
    assert "int tips(" in (tmp_path / "tips.h").read_text()


def test_convert_and_code_refuse_what_they_cannot_do(tmp_path: Path, workbench: Run) -> None:
    motion_file(tmp_path)
    places = np.random.default_rng(0).normal(scale=0.4, size=(2, 23, 3))
    write_trc(tmp_path / "points.trc", Trajectories(places, points(), 30.0, "m"))
    for arguments, said in (
        ("convert walk.npz --to small --out a.npz", "say with --from which body"),
        (
            "convert walk.npz --from small --to hand --out a.npz",
            "'small' and 'hand' have 0 joints of the same names",
        ),
        ("convert walk.npz --from small --to small --out a.fbx", "and not as a.fbx"),
        ("convert points.trc --to small --out a.npz --points face", "there are coco, joints"),
        ("motion walk.npz --out a.glb --correctives many", "a whole number from 0, not 'many'"),
        ("body code --points face --out a.c", "no landmark set is called 'face'"),
        ("body code --out a.cpp", "--out takes a file that ends in .c"),
    ):
        code, _, wrong = workbench(*arguments.split())
        assert code == 2
        assert said in " ".join(wrong.split())
    assert {path.name for path in tmp_path.iterdir()} == {"walk.npz", "points.trc"}
