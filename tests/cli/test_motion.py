"""`workbench motion`: what a file holds, and the same in another format."""

from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.motions.made_files import MARKER_FILES, MOTION_FILES
from tests.motions.made_results import RESULTS, truth
from workbench.fitting import read_markers

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
