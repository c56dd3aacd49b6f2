"""A motion from named points in space."""

import numpy as np
import pytest

import workbench as wb
from benchmarks.clips_made_up import clip
from workbench.bodies.hand_points import HAND_POINTS
from workbench.bodies.pose_space import pose_space
from workbench.conversion import motion_from_points, point_sets
from workbench.conversion.points_in_space import body_points, plain_name
from workbench.errors import BadArgument, UnknownName

SMALL, HAND = wb.load_body("small"), wb.load_body("hand")
COCO = SMALL.landmark_names("coco")


@pytest.mark.parametrize(
    ("label", "plain"),
    [
        ("RBigToe", "right_big_toe"),
        ("LEye", "left_eye"),
        ("left hip", "left_hip"),
        ("R_Knee", "right_knee"),
        ("leftElbow", "left_elbow"),
        ("Nose", "nose"),
    ],
)
def test_labels_are_spelt_as_bodies_spell_them(label: str, plain: str) -> None:
    assert plain_name(label) == plain


def test_the_motion_is_found_from_its_joints_with_gaps() -> None:
    """An arm and a whole frame are hidden for a while, and smoothness leads through.

    Frames by themselves leave the arm to the prior, 30 cm away.
    """
    arm = [SMALL.joint_names.index(f"left_{name}") for name in ("elbow", "wrist", "hand")]
    motion = clip(SMALL, 9)
    places = motion.joints(SMALL)
    seen = places.copy()
    seen[3:5, arm] = np.nan
    seen[6] = np.nan
    found = motion_from_points(seen, SMALL.joint_names, SMALL, 30, sigma=2e-3)
    off = 1e3 * np.linalg.norm(found.motion.joints(SMALL) - places, axis=2)
    assert off.mean() < 5
    assert off[6].mean() < 15
    assert off[3:5, arm].max() < 60
    assert found.names == SMALL.joint_names
    assert np.isnan(found.errors[6]).all()
    assert "1 of 9 frames were not found" in " ".join(found.motion.notes)


def test_a_frame_that_jumps_is_found_from_scratch() -> None:
    """The person turns round and bends other limbs; from the frame before, 6 mm would be left."""
    one, other = clip(SMALL, 1, seed=0), clip(SMALL, 1, seed=10)
    pose = np.concatenate([one.pose, other.pose])
    pose[:, 0] = [[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
    trans = np.array([[0.0, 0.9, 0.0], [2.0, 0.9, -1.0]])
    places = wb.Motion(pose, trans, 30, SMALL.joint_names, one.betas).joints(SMALL)
    found = motion_from_points(places, SMALL.joint_names, SMALL, 30, sigma=2e-3)
    assert 1e3 * np.linalg.norm(found.motion.joints(SMALL) - places, axis=2).mean() < 2


def test_keypoints_of_another_spelling_and_order_are_matched() -> None:
    motion = clip(SMALL, 4, seed=1)
    labels = [n.replace("right_", "R_").replace("left_", "L_") for n in COCO]
    labels = [n[:1].upper() + n[1:].title().replace("_", "") for n in labels][::-1]
    given = np.concatenate([motion.landmark(SMALL, "coco")[:, ::-1], np.ones((4, 1, 3))], axis=1)
    found = motion_from_points(given, [*labels, "Racket"], SMALL, 30)
    assert found.names == COCO
    assert 1e3 * np.nanmean(found.errors) < 8
    notes = " ".join(found.motion.notes)
    assert "23 of 24 points are coco of body 'small'" in notes
    assert "left out: Racket" in notes
    joints = motion_from_points(given[:, :23], labels, SMALL, 30, kind="joints")
    assert "12 of 23 points are joints" in " ".join(joints.motion.notes)


def test_a_hand_follows_its_21_points() -> None:
    space = pose_space(HAND, 6)
    pose = space.poses(HAND, np.array([[1.0, 0, 0, 0, 0, 0], [0.5, 0.5, 0, 0, 0, 0]]))
    pose[:, 0] = [0.3, 0.2, -0.5]
    places = body_points(HAND, "hand", pose, np.zeros(10), np.array([[0.1, 0.2, 0.3]] * 2))
    found = motion_from_points(places, HAND_POINTS, HAND, 30, sigma=2e-3)
    assert 1e3 * found.errors.mean() < 1
    assert [*point_sets(HAND)] == ["joints", "tips", "hand"]


def test_points_that_do_not_place_a_body_are_refused() -> None:
    with pytest.raises(BadArgument, match="has 1 among its 'coco', and 4 are needed"):
        motion_from_points(np.zeros((2, 3, 3)), ["nose", "racket", "ball"], SMALL, 30)
    with pytest.raises(BadArgument, match=r"have the shape \(T, 2, 3\), not \(2, 3, 3\)"):
        motion_from_points(np.zeros((2, 3, 3)), ["nose", "racket"], SMALL, 30)
    with pytest.raises(BadArgument, match="two points are called left_eye"):
        motion_from_points(np.zeros((2, 2, 3)), ["LEye", "left_eye"], SMALL, 30)
    with pytest.raises(BadArgument, match="no frame shows 4 of the points"):
        motion_from_points(np.full((2, 23, 3), np.nan), COCO, SMALL, 30)
    with pytest.raises(BadArgument, match="sigma is a standard deviation in m"):
        motion_from_points(np.zeros((2, 23, 3)), COCO, SMALL, 30, sigma=0.0)
    with pytest.raises(UnknownName, match="no set of points is called 'face'"):
        motion_from_points(np.zeros((2, 23, 3)), COCO, SMALL, 30, kind="face")
