"""Motions: frames, names, bones, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from builder.recordings import recorded_motions
from tests.motions.made_files import random_motion
from tests.tiers import few
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.errors import BadArgument, BadFile
from workbench.geometry.guesses import UP_TO_Y
from workbench.motions import Bones, Motion, bones_of
from workbench.motions.motion import without_gaps

SMALL = wb.load_body("small")


def walk(T: int = 7) -> Motion:
    return random_motion(SMALL.n_joints, SMALL.joint_names, T)


def spinning(speed: float, fps: float, T: int) -> Motion:
    """The root turns about a fixed axis at a constant speed in rad/s, and moves along a line."""
    axis = np.array([0.6, 0.0, 0.8])
    times = np.arange(T) / fps
    pose = (speed * times)[:, None, None] * axis[None, None]
    turned = Rotation.from_rotvec(pose.reshape(-1, 3)).as_rotvec().reshape(T, 1, 3)
    return Motion(turned, np.outer(times, [1.0, 2.0, 3.0]), fps, ("root",))


def test_bad_motions_are_refused() -> None:
    for changed, said in [
        (
            {"pose": np.zeros((2, 3))},
            r"pose .*, has the shape \(2, 1, 3\), not \(2, 3\)",
        ),
        (
            {"pose": np.zeros((0, 1, 3)), "trans": np.zeros((0, 3))},
            "in 0 frames, one or more",
        ),
        ({"trans": np.zeros((3, 3))}, r"trans of .* has the shape \(2, 3\), not \(3, 3\)"),
        ({"betas": np.zeros((2, 4))}, r"betas of .* has the shape \(B\), not \(2, 4\)"),
        ({"expression": np.zeros((3, 4))}, r"expression of .* has the shape \(2, E\)"),
        ({"trans": np.full((2, 3), np.nan)}, r"trans is nan at \[0, 0\]; leave such frames out"),
        ({"fps": 0.0}, "fps is a number above 0, not 0.0"),
        ({"fps": np.inf}, "fps is a number above 0"),
        ({"fps": True}, "fps is a number above 0"),
        ({"joint_names": ("a", "a"), "pose": np.zeros((2, 2, 3))}, "two joints are called a"),
        ({"bones": Bones((-1, 0), np.zeros((2, 3)))}, "the skeleton has 2 joints, and 1 have"),
    ]:
        given = {"pose": np.zeros((2, 1, 3)), "trans": np.zeros((2, 3)), "fps": 10.0}
        with pytest.raises(BadArgument, match=said):
            Motion(**({"joint_names": ("root",)} | given | changed))  # type: ignore[arg-type]


def test_bones_that_are_no_tree_are_refused() -> None:
    for parents in [(-1, -1), (-1, 2, 1)]:
        with pytest.raises(BadArgument, match="each other joint comes after its parent"):
            Bones(parents, np.zeros((len(parents), 3)))


def test_slices_keep_frames_and_time() -> None:
    motion = walk()
    some = motion[2:6]
    assert np.array_equal(some.pose, motion.pose[2:6])
    assert some.fps == motion.fps
    assert motion[::2].fps == motion.fps / 2
    assert motion[::2].seconds == pytest.approx(motion.seconds)
    for wrong in (slice(5, 5), slice(6, 2, -1), slice(99, None)):
        with pytest.raises(BadArgument, match="takes no frame, or goes back"):
            motion[wrong]
    with pytest.raises(BadArgument, match=r"a slice, such as motion\[10:50\]"):
        motion[3]  # type: ignore[index]


@pytest.mark.parametrize("fps", [7.0, 25.0])
def test_constant_turns_are_resampled_exactly(fps: float) -> None:
    """Slerp is the exact answer for it, also where rotation vectors jump from pi to -pi."""
    resampled, T = spinning(5.0, 10.0, 21).resampled(fps), int(2 * fps) + 1
    exact = spinning(5.0, fps, T)
    assert len(resampled) == T
    apart = Rotation.from_rotvec(resampled.pose[:, 0]).inv() * Rotation.from_rotvec(
        exact.pose[:, 0]
    )
    assert apart.magnitude().max() < 1e-12
    np.testing.assert_allclose(resampled.trans, exact.trans, atol=1e-12)


def test_resampling_there_and_back_is_identity() -> None:
    motion = walk()
    assert np.array_equal(motion.resampled(motion.fps).pose, motion.pose)
    there = motion.resampled(3 * motion.fps)
    assert len(there) == 3 * (len(motion) - 1) + 1
    assert np.array_equal(there.resampled(motion.fps).pose, motion.pose)
    for wrong in (0.0, -1.0, np.nan, 1e12):
        with pytest.raises(BadArgument, match=r"fps is a number above 0|too many frames"):
            motion.resampled(wrong)


def test_turned_motion_turns_the_surface() -> None:
    """t' = R t + (R - I) J_0: without J_0 the surface is displaced, the same in all frames."""
    motion, R = walk(), Rotation.from_rotvec([0.3, -1.2, 0.5]).as_matrix()
    root = SMALL.joints(betas=motion.betas)[0] + [0.0, 0.0, 0.0]
    before = motion.vertices(SMALL)
    turned = motion.turned(R, root).vertices(SMALL)
    np.testing.assert_allclose(turned, before @ R.T, atol=1e-12)
    off = motion.turned(R, root + [0.0, 0.2, 0.0]).vertices(SMALL) - turned
    np.testing.assert_allclose(
        off, np.broadcast_to((R - np.eye(3)) @ [0, 0.2, 0], off.shape), atol=1e-12
    )


def test_motion_plays_as_the_body() -> None:
    motion = walk()
    one_by_one = [
        SMALL.vertices(pose, motion.betas, trans)
        for pose, trans in zip(motion.pose, motion.trans, strict=True)
    ]
    np.testing.assert_allclose(motion.vertices(SMALL), one_by_one, atol=1e-12)
    np.testing.assert_allclose(
        motion.landmark(SMALL, "coco"),
        [
            SMALL.landmark("coco", p, motion.betas, t)
            for p, t in zip(motion.pose, motion.trans, strict=True)
        ],
        atol=1e-12,
    )


def test_bones_move_as_the_joints_of_the_body() -> None:
    motion = walk()
    bones = bones_of(SMALL, motion.betas)
    np.testing.assert_allclose(
        bones.joints(motion.pose, motion.trans), motion.joints(SMALL), atol=1e-12
    )
    ends = bones.ends(motion.pose, motion.trans)
    lengths = np.linalg.norm(ends - motion.joints(SMALL)[:, list(bones.end_parents)], axis=2)
    expected = np.linalg.norm(bones.end_offsets, axis=1)
    np.testing.assert_allclose(lengths, np.broadcast_to(expected, lengths.shape), atol=1e-12)
    head = bones.end_parents.index(SMALL.joint_names.index("head"))
    assert 0.1 < bones.end_offsets[head, 1] < 0.3


def test_joints_are_matched_by_name() -> None:
    motion = random_motion(52, (*BODY, *HANDS))
    here = motion.named(SMALL)
    assert np.array_equal(here.pose[:, :22], motion.pose[:, :22])
    assert not here.pose[:, 22:].any()
    said = " ".join(here.notes)
    assert "the motion lacks stay at rest: left_hand, right_hand" in said
    assert "the body lacks are left out: left_index1, left_index2" in said
    strange = Motion(np.zeros((1, 1, 3)), np.zeros((1, 3)), 10.0, ("tail",))
    with pytest.raises(BadArgument, match=r"1 joints of the motion .tail., 0 have"):
        strange.vertices(SMALL)
    with pytest.raises(BadArgument, match="no bones of its own; give a body"):
        strange.joints()


def test_root_stays_when_another_body_plays() -> None:
    """Its own bones may rest elsewhere: trans differs by the difference of the roots at rest."""
    motion = walk()
    bones = bones_of(SMALL, motion.betas)
    moved = Bones(bones.parents, bones.offsets + np.eye(24, 1) * [0.1, 0.2, 0.3])
    given = Motion(motion.pose, motion.trans, 60.0, motion.joint_names, motion.betas, bones=moved)
    np.testing.assert_allclose(given.joints()[:, 0], given.joints(SMALL)[:, 0], atol=1e-12)


def test_gaps_are_filled_between_frames() -> None:
    motion = spinning(2.0, 10.0, 12)
    pose, trans = motion.pose.copy(), motion.trans.copy()
    pose[[0, 4, 5, 11]] = np.nan
    trans[6] = np.nan
    filled, lines, said = without_gaps(pose, {"trans": trans})
    np.testing.assert_allclose(filled, motion.pose[1:11], atol=1e-12)
    np.testing.assert_allclose(lines["trans"], motion.trans[1:11], atol=1e-12)
    assert said == (
        "3 of 12 frames were not found, and are interpolated",
        "2 of 12 frames at the ends were not found, and are left out",
    )
    with pytest.raises(BadArgument, match="no frame of the motion is whole"):
        without_gaps(np.full((2, 1, 3), np.nan), {"trans": np.zeros((2, 3))})


@pytest.mark.parametrize("axis", few(UP_TO_Y, 2))
def test_axis_up_is_where_the_root_points(axis: str) -> None:
    motion = random_motion(1, ("root",), 40).turned(UP_TO_Y[axis].T)
    found, clear = motion.up
    assert found == axis
    assert clear > 0.9


def recording(path: Path, **changed: Any) -> Path:
    poses = np.random.default_rng(0).normal(0, 0.02, (12, 72))
    entries = {
        "poses": poses,
        "trans": poses[:, :3],
        "ok": np.array([1, 1, 1, 0, 1, 1, 1, 0, 1, 0, 1, 1], dtype=bool),
        "clip": np.array([0] * 5 + [1] * 7, np.uint8),
        "clip_name": np.array(["walk", "run"]),
        "joint_names": np.array(SMALL.joint_names),
        "fps": np.array(10.0),
    }
    np.savez(path, **entries | changed)
    return path


def test_recordings_are_cut_at_bad_frames(tmp_path: Path) -> None:
    path = recording(tmp_path / "mocap.npz")
    motions = recorded_motions(path)
    assert [motion.origin for motion in motions] == [
        "walk, frames 0 to 2",
        "run, frames 0 to 1",
        "run, frames 5 to 6",
    ]
    with np.load(path) as arrays:
        np.testing.assert_array_equal(motions[1].pose.reshape(2, 72), arrays["poses"][5:7])
    assert motions[0].fps == 10
    for wrong in ({"fps": np.array(0.0)}, {"poses": np.zeros((12, 71))}):
        with pytest.raises(BadFile, match="is no recording in the layout described"):
            recorded_motions(recording(tmp_path / "mocap.npz", **wrong))
