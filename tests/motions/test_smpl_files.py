"""AMASS in both layouts, the workbench's own files, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.motions.made_files import amass_entries, newer_entries, random_motion
from workbench.arrays import Array
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.errors import BadFile
from workbench.motions import Bones, Motion, read_motion, save_motion

SMALL = wb.load_body("small")
XNAMES = (*BODY, "jaw", "left_eye", "right_eye", *HANDS)


def walk() -> Motion:
    return random_motion(SMALL.n_joints, SMALL.joint_names)


def saved(folder: Path, entries: dict[str, Any]) -> Path:
    path = folder / "walk.npz"
    np.savez(path, **entries)
    return path


def with_z_up(motion: Motion) -> dict[str, Array]:
    """What AMASS would hold of it, for the small body: its root included."""
    root = SMALL.joints(betas=motion.betas)[0]
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    there = motion.turned(turn, root)
    return amass_entries(motion) | {"poses": there.pose.reshape(-1, 72), "trans": there.trans}


def test_older_layout_is_turned_about_the_root(tmp_path: Path) -> None:
    """Trans differs by (R - I) J_0, so that the body has to be known."""
    motion = walk()
    path = saved(tmp_path, with_z_up(motion))
    found = read_motion(path, body=SMALL)
    np.testing.assert_allclose(found.vertices(SMALL), motion.vertices(SMALL), atol=1e-12)
    assert found.fps == motion.fps
    assert found.joint_names == SMALL.joint_names
    said = " ".join(found.notes)
    assert "made for SMPL of the gender female" in said
    assert "z is taken to be up, along which the root's own y axis points" in said
    assert "not read are dmpls" in said
    alone = read_motion(path)
    apart = alone.vertices(SMALL) - motion.vertices(SMALL)
    np.testing.assert_allclose(apart, np.broadcast_to(apart[0, 0], apart.shape), atol=1e-12)
    assert any("give the body to correct it" in note for note in alone.notes)


def test_newer_layout_is_read_whole_and_in_parts(tmp_path: Path) -> None:
    motion = random_motion(55, XNAMES)
    entries = newer_entries(motion)
    whole = read_motion(saved(tmp_path, entries))
    assert whole.joint_names == XNAMES
    np.testing.assert_allclose(whole.pose, motion.pose, atol=1e-12)
    parts = read_motion(saved(tmp_path, {k: v for k, v in entries.items() if k != "poses"}))
    assert parts.joint_names == XNAMES
    np.testing.assert_array_equal(parts.pose, whole.pose)
    assert any("not read are num_betas, surface_model_type" in note for note in parts.notes)
    few = {k: v for k, v in entries.items() if k not in ("poses", "pose_hand", "pose_eye")}
    assert read_motion(saved(tmp_path, few)).joint_names == (*BODY, "jaw")


def test_motion_survives_its_file(tmp_path: Path) -> None:
    bones = Bones((-1, 0), np.array([[0.0, 1, 0], [0, 0.5, 0]]), (1,), np.array([[0, 0.2, 0.0]]))
    pose = np.random.default_rng(0).normal(0, 1, (5, 2, 3))
    motion = Motion(
        pose,
        pose[:, 0],
        59.94,
        ("hips", "chest"),
        (0.5,),  # type: ignore[arg-type]
        np.ones((5, 3)),
        bones,
        "made up",
        ("a sentence",),
    )
    save_motion(tmp_path / "walk.npz", motion)
    found = read_motion(tmp_path / "walk.npz")
    for name in ("pose", "trans", "betas", "expression"):
        np.testing.assert_array_equal(getattr(found, name), getattr(motion, name))
    assert (found.fps, found.joint_names) == (59.94, ("hips", "chest"))
    assert (found.origin, found.notes) == ("made up", ("a sentence",))
    assert found.bones is not None
    np.testing.assert_array_equal(found.joints(), motion.joints())
    np.testing.assert_array_equal(found.bones.end_offsets, bones.end_offsets)
    with np.load(tmp_path / "walk.npz") as arrays:  # AMASS's names
        assert arrays["poses"].shape == (5, 6)
        assert {"trans", "betas", "mocap_framerate", "gender"} <= set(arrays)
        assert str(arrays["gender"]) == "neutral"
    with pytest.raises(BadFile, match=r"a motion is saved as \.npz"):
        save_motion(tmp_path / "walk.txt", motion)


def test_gender_is_kept_or_said_to_be_lost(tmp_path: Path) -> None:
    found = read_motion(saved(tmp_path, amass_entries(walk())))
    assert found.gender == "female"
    save_motion(tmp_path / "again.npz", found.resampled(5.0)[:3].named(SMALL))
    assert read_motion(tmp_path / "again.npz").gender == "female"
    entries = amass_entries(walk()) | {"gender": np.array("male", dtype=object)}
    lost = read_motion(saved(tmp_path, entries))
    assert lost.gender == ""
    assert any(note.startswith("not read are") and "gender" in note for note in lost.notes)


def test_frames_of_nan_are_filled(tmp_path: Path) -> None:
    entries = amass_entries(walk())
    entries["poses"][2, 5] = np.nan
    entries["trans"][0] = np.nan
    found = read_motion(saved(tmp_path, entries))
    assert len(found) == len(walk()) - 1
    assert "1 of 6 frames were not found, and are interpolated" in found.notes
    assert "1 of 6 frames at the ends were not found, and are left out" in found.notes


def without(name: str) -> dict[str, Any]:
    return {k: v for k, v in amass_entries(walk()).items() if k != name}


OLD = amass_entries(walk())


def test_damaged_motions_are_refused(tmp_path: Path) -> None:
    for entries, said in [
        (without("poses"), "pose_body missing; it holds betas, dmpls, gender"),
        (without("trans"), "trans missing"),
        (without("mocap_framerate"), "no mocap_framerate, mocap_frame_rate or fps; give its rate"),
        (OLD | {"mocap_framerate": np.array(0.0)}, "rate is not one number of frames"),
        (OLD | {"fps": np.array(30.0)}, "rate is not one number of frames"),
        (OLD | {"trans": np.zeros((7, 3))}, "trans|poses"),
        (OLD | {"poses": np.zeros((6, 71))}, "poses has 71 columns, and three belong to each"),
        (OLD | {"poses": np.zeros((0, 72)), "trans": np.zeros((0, 3))}, "which is no frame"),
        (OLD | {"poses": np.full((6, 72), 1e9)}, "poses holds numbers beyond 1e.06"),
        (OLD | {"betas": np.arange(60.0).reshape(6, 10)}, "betas change from frame to frame"),
        (OLD | {"betas": np.full(10, np.nan)}, "betas is nan"),
        (OLD | {"poses": np.array([None])}, "poses needs allow_pickle, which would run code"),
        (
            newer_entries(random_motion(55, XNAMES)) | {"pose_body": np.ones((6, 63))},
            "poses and root_orient, pose_body, pose_jaw, pose_eye, pose_hand say different",
        ),
        (OLD | {"joint_names": np.array(["a", "a"])}, "poses has 24 joints, and joint_names 2"),
    ]:
        with pytest.raises(BadFile, match=said) as refused:
            read_motion(saved(tmp_path, entries))
        assert "walk.npz is no motion (" in str(refused.value)


def test_rate_and_axis_can_be_given(tmp_path: Path) -> None:
    path = saved(tmp_path, without("mocap_framerate"))
    found = read_motion(path, fps=12.0, up="y")
    assert found.fps == 12.0
    np.testing.assert_array_equal(found.trans, OLD["trans"])
    with pytest.raises(BadFile, match=r"that ends in \.npz, \.bvh"):
        read_motion(tmp_path / "walk.fbx")
    with pytest.raises(BadFile, match=r"there is no file .*walk2\.npz"):
        read_motion(tmp_path / "walk2.npz")
