"""Motions converted between bodies, correspondences of surfaces, and motions from points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies.model_files import with_fingers, written
from tests.bodies_made_up import tube_body
from tests.clips_made_up import clip
from workbench.bodies.body import Body
from workbench.bodies.hands import HAND_POINTS
from workbench.bodies.spaces import pose_space
from workbench.conversion import (
    conversion_errors,
    convert,
    correspond,
    motion_from_points,
    point_sets,
)
from workbench.conversion.converting import doubts_of, skeleton_errors
from workbench.conversion.points_in_space import body_points
from workbench.errors import BadArgument, UnknownName
from workbench.motions import bones_of, read_bvh, write_bvh

SMALL, DEFAULT, HAND = (wb.load_body(name) for name in ("small", "default", "hand"))


@pytest.fixture(scope="module")
def fingers(tmp_path_factory: pytest.TempPathFactory) -> Body:
    """The body `small` with 52 joints."""
    return wb.load_body(written(with_fingers("small"), tmp_path_factory.mktemp("h") / "SMPLH.pkl"))


def test_body_is_converted_to_itself() -> None:
    motion = clip(SMALL, 4)
    told: list[tuple[str, int, int]] = []
    found = convert(motion, SMALL, SMALL, progress=lambda *step: told.append(step))
    assert 1e3 * found.mean() < 0.1
    np.testing.assert_allclose(found.motion.betas, motion.betas, atol=0.05)
    np.testing.assert_allclose(found.motion.trans, motion.trans, atol=1e-3)
    assert found.motion.origin == "converted from body 'small': made up"
    assert told[-1] == ("poses", 4, 4)


def test_motion_is_measured_against_its_own_skeleton() -> None:
    motion = clip(SMALL, 2).named(SMALL)
    bones = bones_of(SMALL, motion.betas)
    own = skeleton_errors(motion, SMALL, replace(motion, bones=bones))
    assert own is not None
    assert own.max() < 1e-6
    half = replace(bones, offsets=0.5 * bones.offsets)
    other = skeleton_errors(motion, SMALL, replace(motion, bones=half))
    assert other is not None
    assert other.mean() > 0.1
    assert skeleton_errors(motion, SMALL, motion) is None


def test_motions_that_are_far_off_are_doubted() -> None:
    motion, errors = replace(clip(SMALL, 2), betas=np.zeros(2)), np.full((2, 5), 0.01)
    assert doubts_of(motion, SMALL, errors, "the points") == ()
    (far,) = doubts_of(motion, SMALL, 10 * errors, "the points")
    assert "10 cm from the points" in far
    shape, *_ = doubts_of(replace(motion, betas=6 * np.eye(2)[0]), SMALL, errors, "the points")
    assert "betas[0] is 6.0 standard deviations" in shape


@pytest.mark.thorough
@pytest.mark.parametrize("back", [False, True])
def test_joints_24_become_52_and_back(fingers: Body, back: bool) -> None:
    source, target = (fingers, SMALL) if back else (SMALL, fingers)
    assert sorted((source.n_joints, target.n_joints)) == [24, 52]
    motion = clip(source, 5, seed=2)
    found = convert(motion, source, target)
    assert found.mean() < 5e-3
    assert found.motion.joint_names == target.joint_names


def test_another_mesh_follows_within_millimetres() -> None:
    motion = clip(DEFAULT, 5, seed=1)
    kept = correspond(DEFAULT, SMALL)
    found = convert(motion, DEFAULT, SMALL, correspondence=kept)
    assert found.correspondence is kept
    copied = conversion_errors(motion.named(SMALL), SMALL, motion, DEFAULT, kept)
    assert found.mean() < 3e-3
    assert found.mean() < 0.3 * np.nanmean(copied)
    places = kept.of(motion.vertices(DEFAULT))
    off = np.linalg.norm(found.motion.vertices(SMALL) - places, axis=2)
    np.testing.assert_allclose(found.errors[:, kept.matched], off[:, kept.matched], atol=1e-12)
    assert np.isnan(found.errors[:, ~kept.matched]).all()
    means = [mean for mean, _ in found.by_part.values()]
    assert means == sorted(means, reverse=True)
    assert {"left_forearm", "head", "right_fingers"} <= {*found.by_part}


def test_converted_frames_may_jump() -> None:
    """From one frame to the next the person turns round, with other limbs bent."""
    first, second = clip(SMALL, 1, seed=3), clip(SMALL, 1, seed=4)
    pose = np.concatenate([first.pose, second.pose])
    pose[1, 0] = [0.0, 3.0, 0.0]
    trans = np.array([[0.0, 0.9, 0.0], [2.0, 0.9, -1.0]])
    motion = wb.Motion(pose, trans, 30, SMALL.joint_names, first.betas)
    assert 1e3 * convert(motion, SMALL, SMALL).errors.max() < 1.0


def test_correspondence_of_other_bodies_is_refused() -> None:
    kept = correspond(SMALL, SMALL)
    with pytest.raises(BadArgument, match="takes 369 vertices to 369, but bodies 'default'"):
        convert(clip(DEFAULT, 2), DEFAULT, SMALL, correspondence=kept)


def test_triangle_bodies_are_written_with_bones_at_rest(tmp_path: Path) -> None:
    triangles, motion = wb.load_body("small-scape"), clip(SMALL, 2)
    write_bvh(tmp_path / "a.bvh", motion, triangles)
    found, bones = read_bvh(tmp_path / "a.bvh"), bones_of(triangles, motion.betas)
    order = [found.joint_names.index(name) for name in triangles.joint_names]
    # Those of the surface are elsewhere, because its bones stretch; a .bvh has bones of one length.
    own = bones.joints(motion.pose, motion.trans)
    np.testing.assert_allclose(found.joints()[:, order], own, atol=1e-5)


def test_the_same_triangles_correspond_one_to_one() -> None:
    found = correspond(DEFAULT, wb.load_body("default-male"))
    assert found.same
    assert found.matched.all()
    surface = DEFAULT.vertices()
    np.testing.assert_array_equal(found.of(surface), surface)
    assert str(found) == "the same triangles: 1229 vertices correspond one to one"


def test_vertices_of_a_coarse_mesh_lie_on_the_fine_one() -> None:
    found = correspond(DEFAULT, SMALL)
    assert found.matched.mean() > 0.95
    assert not found.same
    assert found.distances[found.matched].mean() < 2e-3
    np.testing.assert_allclose(found.places.sum(axis=1), 1.0)
    there = SMALL.vertices(*(found.rest[name] for name in ("pose", "betas", "trans")))
    off = np.linalg.norm(found.of(DEFAULT.vertices()) - there, axis=1)
    np.testing.assert_allclose(off, found.distances, atol=1e-5)


def test_bodies_without_common_joints_are_refused() -> None:
    with pytest.raises(BadArgument, match="'tube' have 0 joints of the same names"):
        correspond(DEFAULT, tube_body())


COCO = SMALL.landmark_names("coco")


def test_motion_is_recovered_from_joints_with_gaps() -> None:
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


def test_points_of_other_spelling_are_matched() -> None:
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


def test_hand_is_recovered_from_its_points() -> None:
    space = pose_space(HAND, 6)
    pose = space.poses(HAND, np.array([[1.0, 0, 0, 0, 0, 0], [0.5, 0.5, 0, 0, 0, 0]]))
    pose[:, 0] = [0.3, 0.2, -0.5]
    places = body_points(HAND, "hand", pose, np.zeros(10), np.array([[0.1, 0.2, 0.3]] * 2))
    found = motion_from_points(places, HAND_POINTS, HAND, 30, sigma=2e-3)
    assert 1e3 * found.errors.mean() < 1
    assert [*point_sets(HAND)] == ["joints", "tips", "hand"]


def test_bad_points_in_space_are_refused() -> None:
    with pytest.raises(BadArgument, match="has 1 among its 'coco', and 4 are needed"):
        motion_from_points(np.zeros((2, 3, 3)), ["nose", "racket", "ball"], SMALL, 30)
    with pytest.raises(BadArgument, match=r"have the shape \(T, 2, 3\), not \(2, 3, 3\)"):
        motion_from_points(np.zeros((2, 3, 3)), ["nose", "racket"], SMALL, 30)
    with pytest.raises(BadArgument, match="two points are called LEye and left_eye"):
        motion_from_points(np.zeros((2, 2, 3)), ["LEye", "left_eye"], SMALL, 30)
    with pytest.raises(BadArgument, match="no frame shows 4 of the points"):
        motion_from_points(np.full((2, 23, 3), np.nan), COCO, SMALL, 30)
    with pytest.raises(BadArgument, match="sigma is a standard deviation in m"):
        motion_from_points(np.zeros((2, 23, 3)), COCO, SMALL, 30, sigma=0.0)
    with pytest.raises(UnknownName, match="no set of points is called 'face'"):
        motion_from_points(np.zeros((2, 23, 3)), COCO, SMALL, 30, kind="face")
