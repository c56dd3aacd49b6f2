"""BVH: forward kinematics written out by hand, other readers, round trips, and what is refused."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.motions.made_files import REFERENCE, bvh_rows, bvh_text, odd_text, random_motion
from workbench.arrays import Array
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.motions import Motion, read_bvh, read_motion, write_bvh

SMALL = wb.load_body("small")
NAMES = ("Hips", "Left Leg", "LeftFoot", "Chest")


def about(axis: str, degrees: float) -> Array:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return {
        "X": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "Y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "Z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def by_hand(row: Array) -> Array:
    """The four joints and two ends of HIERARCHY in one frame, (6, 3) cm."""
    a = iter(row[3:])
    R = [np.linalg.multi_dot([about(x, next(a)) for x in order]) for order in ("ZYX", "XYZ", "YZX")]
    chest = about("Z", next(a)) @ about("X", next(a))
    hips = row[:3]  # whatever its OFFSET
    leg = hips + R[0] @ [10, -5, 0]
    foot = leg + R[0] @ R[1] @ [0, -85, 1]
    spine = hips + R[0] @ [0, 55, 0]
    toe = foot + R[0] @ R[1] @ R[2] @ [0, 0, 12.5]
    return np.array([hips, leg, foot, spine, toe, spine + R[0] @ chest @ [0, 30, 0]])


def saved(folder: Path, text: str) -> Path:
    path = folder / "walk.bvh"
    path.write_text(text)
    return path


def places(motion: Motion) -> Array:
    assert motion.bones is not None
    ends = motion.bones.ends(motion.pose, motion.trans)
    return np.concatenate([motion.joints(), ends], axis=1)


def walk() -> Motion:
    return random_motion(SMALL.n_joints, SMALL.joint_names)


def test_joints_match_kinematics_by_hand(tmp_path: Path) -> None:
    motion = read_bvh(saved(tmp_path, bvh_text(bvh_rows())))
    assert motion.joint_names == NAMES
    expected = np.array([by_hand(row) for row in bvh_rows()]) / 100
    np.testing.assert_allclose(places(motion), expected, atol=1e-8)
    assert motion.fps == 30
    assert "the frame time 0.0333333 s is taken for 30 frames a second" in motion.notes
    assert "positions of the root take the place of its OFFSET, which is not zero" in motion.notes


def test_bvh_survives_its_file(tmp_path: Path) -> None:
    motion = walk()
    write_bvh(tmp_path / "walk.bvh", motion, SMALL)
    read = read_motion(tmp_path / "walk.bvh")
    order = [read.joint_names.index(name) for name in SMALL.joint_names]
    np.testing.assert_allclose(read.joints()[:, order], motion.joints(SMALL), atol=1e-6)
    played = Motion(
        read.pose, read.trans, read.fps, read.joint_names, motion.betas, bones=read.bones
    )
    np.testing.assert_allclose(played.vertices(SMALL), motion.vertices(SMALL), atol=1e-6)
    write_bvh(tmp_path / "again.bvh", read)
    np.testing.assert_allclose(places(read_bvh(tmp_path / "again.bvh")), places(read), atol=1e-6)


@pytest.mark.thorough
def test_bvhio_reads_the_same_joints(tmp_path: Path) -> None:
    bvhio = pytest.importorskip("bvhio", reason="another reader of BVH; pip install bvhio")
    motion = walk()
    write_bvh(tmp_path / "walk.bvh", motion, SMALL)
    root = bvhio.readAsHierarchy(str(tmp_path / "walk.bvh"))
    joints = np.empty((len(motion), 24, 3))
    for t in range(len(motion)):
        root.loadPose(t)
        for joint, _, _ in root.layout():
            joints[t, SMALL.joint_names.index(joint.Name)] = np.array(joint.PositionWorld)
    np.testing.assert_allclose(joints / 100, motion.joints(SMALL), atol=1e-5)


def test_limbs_at_gimbal_lock_are_written(tmp_path: Path) -> None:
    """There two of the three angles turn about one axis, of which SciPy warns."""
    pose = np.zeros((3, 24, 3))
    pose[:, 1:, 0] = np.radians([89.9999999, 90.0, 90.1])[:, None]
    motion = Motion(pose, np.zeros((3, 3)), 10.0, SMALL.joint_names)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_bvh(tmp_path / "walk.bvh", motion, SMALL)
    read = read_bvh(tmp_path / "walk.bvh")
    order = [read.joint_names.index(name) for name in SMALL.joint_names]
    np.testing.assert_allclose(read.joints()[:, order], motion.joints(SMALL), atol=1e-6)


def scaled_bvh(tmp_path: Path, motion: Motion, scale: float) -> Path:
    """A file of the motion whose lengths are in cm / scale."""
    write_bvh(tmp_path / "walk.bvh", motion, SMALL)
    lines = []
    text, _, rows = (tmp_path / "walk.bvh").read_text().partition("Frame Time")
    for line in text.splitlines():
        key, _, rest = line.strip().partition(" ")
        scaled = (
            " ".join(f"{scale * float(x):.9f}" for x in rest.split()) if key == "OFFSET" else rest
        )
        lines.append(f"{key} {scaled}")
    time, *frames = rows.splitlines()
    numbers = np.array([line.split() for line in frames], dtype=float)
    numbers[:, :3] *= scale
    body = [" ".join(f"{x:.9f}" for x in row) for row in numbers]
    return saved(tmp_path, "\n".join([*lines, f"Frame Time{time}", *body]))


@pytest.mark.parametrize(("scale", "name"), [(0.01, "m"), (0.45 / 2.54, "cmu"), (1 / 2.54, "in")])
def test_unit_of_bvh_is_guessed(tmp_path: Path, scale: float, name: str) -> None:
    motion = walk()
    path = scaled_bvh(tmp_path, motion, scale)
    read = read_bvh(path)
    assert f"the unit is taken to be {name}, " in read.notes[0]
    order = [read.joint_names.index(n) for n in SMALL.joint_names]
    np.testing.assert_allclose(read.joints()[:, order], motion.joints(SMALL), atol=2e-6)
    given = read_bvh(path, unit=name, up="y")
    assert given.notes[0].startswith(f"the unit {name} was given; the skeleton would stand 1.")
    assert given.notes[1] == "the axis y was given as up"
    with pytest.raises(UnknownName, match="no unit is called 'ell'"):
        read_bvh(path, unit="ell")


@pytest.mark.parametrize(("scale", "name"), [(1.0, "cm"), (1 / 2.54, "in"), (0.45 / 2.54, "cmu")])
def test_unit_of_a_person_who_crouches_is_told_by_the_bones(
    tmp_path: Path, scale: float, name: str
) -> None:
    pose = np.zeros((3, 24, 3))
    for joint, bend in (("hip", -2.0), ("knee", 2.2)):
        for side in ("left", "right"):
            pose[:, SMALL.joint_names.index(f"{side}_{joint}"), 0] = bend
    for side, down in (("left", -1.3), ("right", 1.3)):
        pose[:, SMALL.joint_names.index(f"{side}_shoulder"), 2] = down
    motion = Motion(pose, np.zeros((3, 3)), 30.0, SMALL.joint_names)
    read = read_bvh(scaled_bvh(tmp_path, motion, scale))
    assert f"taken to be {name}, in which the skeleton would stand 1.6" in read.notes[0]


@pytest.mark.parametrize("whole", [True, False])
def test_positions_below_the_root_replace_offsets(tmp_path: Path, whole: bool) -> None:
    text = bvh_text(bvh_rows()).replace(
        "CHANNELS 3 Xrotation Yrotation Zrotation",
        "CHANNELS 6 Xrotation Yposition Xposition Zposition Yrotation Zrotation",
    )
    head, _, rows = text.partition("0.0333333\n")
    numbers = np.array([line.split() for line in rows.splitlines()], dtype=float)
    bone = np.array([-5.0, 10.0, 0.0]) if whole else np.array([0.01, 0.02, 0.0])  # y, x, z
    between = np.insert(numbers, [7, 7, 7], bone, axis=1)
    body = "\n".join(" ".join(map(str, row)) for row in between)
    motion = read_bvh(saved(tmp_path, f"{head}0.0333333\n{body}\n"))
    expected = np.array([by_hand(row) for row in bvh_rows()]) / 100
    np.testing.assert_allclose(places(motion), expected, atol=1e-8 if whole else 3e-4)
    assert ("take the place of" if whole else "are added to") in motion.notes[-1]
    between[0, 7] += 5.0  # cm
    body = "\n".join(" ".join(map(str, row)) for row in between)
    with pytest.raises(BadFile, match="bones change their length by up to 0"):
        read_bvh(saved(tmp_path, f"{head}0.0333333\n{body}\n"))


EXPECTED = np.array([by_hand(row) for row in bvh_rows()]) / 100
VARIANTS = {  # `odd_text` has a byte-order mark, decimal commas, comments, a prop, too few rows
    "lines of Windows": (bvh_text(bvh_rows()).replace("\n", "\r\n"), ""),
    "commas between numbers": (re.sub(r"(?<=\d) (?=-?\d+\.)", ", ", bvh_text(bvh_rows())), ""),
    "more rows": (
        bvh_text(bvh_rows()).replace("Frames: 6", "Frames: 2"),
        "it has 6 frames, and says 2",
    ),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_bvh_is_read_as_programs_write_it(tmp_path: Path, name: str) -> None:
    text, note = VARIANTS[name]
    path = tmp_path / "walk.bvh"
    path.write_bytes(text.encode())
    motion = read_bvh(path)
    assert motion.joint_names == NAMES
    np.testing.assert_allclose(places(motion), EXPECTED, atol=1e-6)
    assert note in " ".join(motion.notes)
    assert motion.fps == 30


def test_hips_that_move_below_a_root_become_the_root(tmp_path: Path) -> None:
    """In a file that has everything else that is odd as well."""
    path = tmp_path / "odd.bvh"
    path.write_text(odd_text(), encoding="utf-8")
    motion = read_bvh(path)
    x, y, z, *angles = REFERENCE
    R = np.linalg.multi_dot([about(axis, a) for axis, a in zip("ZYX", angles, strict=True)])
    np.testing.assert_allclose(
        places(motion), EXPECTED @ R.T + np.array([x, y, z]) / 100, atol=1e-6
    )
    assert motion.joint_names == NAMES
    notes = " ".join(motion.notes)
    assert "left out at the root, because their child moves away: Reference" in notes
    assert "of 2 skeletons that of 'Reference' is read" in notes
    assert f"it has {len(motion)} frames, and says {len(motion) + 1}" in notes


WHOLE = bvh_text(bvh_rows())


def test_damaged_bvh_is_refused(tmp_path: Path) -> None:
    for text, said in [
        ("", "begins with '', and not with HIERARCHY"),
        (WHOLE.replace("HIERARCHY", "HIERARCHIES", 1), "begins with 'HIERARCHIES'"),
        (WHOLE.replace("JOINT Chest {", "ROOT Chest {"), "is 'ROOT Chest'"),
        (WHOLE.replace("\nMOTION", "\nROOT B\n{\nMOTION", 1), "is 'MOTION', which is not exp"),
        (WHOLE.replace("\n}\nMOTION", "\nMOTION"), "is 'MOTION', which is not expected"),
        (WHOLE.replace("OFFSET 0.0 55.0 0.0", "", 1), "'Chest' has no OFFSET or no CHANNELS"),
        (WHOLE.replace("OFFSET 0.0 55.0 0.0", "OFFSET 0 55"), "has 2 numbers, and must have 3"),
        (
            WHOLE.replace("OFFSET 0.0 55.0 0.0", "OFFSET 0 1e99 0"),
            "holds 1e.99, which is no length",
        ),
        (
            WHOLE.replace("OFFSET 0.0 0.0 12.5", ""),
            "the end site that ends at line 17 has no OFFSET",
        ),
        (WHOLE.replace("2 Zrotation", "3 Zrotation"), "has the channels '3 Zrotation Xrotation'"),
        (WHOLE.replace("2 Zrotation Xrotation", "2 Zrotation Wrotation"), "Wrotation"),
        (WHOLE.replace("2 Zrotation Xrotation", "2 Zrotation Zrotation"), "same channel twice"),
        (WHOLE[: WHOLE.index("Time: 0.0333333") + 16], "0 frames of 14 channels"),
        (
            WHOLE.replace("Frames: 6", "Frames: 99999999"),
            "99,999,999 frames of 14 channels are too",
        ),
        (WHOLE.replace("Frames: 6", "Frames: six"), "and not the number of Frames"),
        (WHOLE.replace("Time: 0.0333333", "Time: 0"), "frame time is '0', which is no time"),
        (WHOLE + "nan " * 14, "holds nan, which is no length"),
        (WHOLE.replace(".", "x"), "has the channels|could not convert|OFFSET|line 4"),
        (re.sub(r"OFFSET .*", "OFFSET 0 0 0", WHOLE), "is this the size of a body"),
    ]:
        with pytest.raises(BadFile, match=said) as refused:
            read_bvh(saved(tmp_path, text))
        assert "walk.bvh is no BVH file of one skeleton (" in str(refused.value)


def test_equal_joint_names_get_numbers(tmp_path: Path) -> None:
    motion = read_bvh(saved(tmp_path, WHOLE.replace("Left Leg", "Bone").replace("Chest", "Bone")))
    assert motion.joint_names == ("Hips", "Bone", "LeftFoot", "Bone_2")
    assert any("joints had no name or that of another" in note for note in motion.notes)


def test_motion_without_bones_needs_a_body(tmp_path: Path) -> None:
    with pytest.raises(BadArgument, match="give the body that has them"):
        write_bvh(tmp_path / "walk.bvh", walk())
    assert not list(tmp_path.iterdir())
