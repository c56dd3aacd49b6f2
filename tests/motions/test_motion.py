"""A motion: what it accepts, its frames at other times, and how it moves bodies."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from tests.motions.made_files import random_motion
from workbench.arrays import Array
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.errors import BadArgument, NotNumbers
from workbench.geometry.upright import TURNS
from workbench.motions import Bones, Motion, bones_of
from workbench.motions.gaps import without_gaps

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


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"pose": np.zeros((2, 3))}, r"shape \(T, 1, 3\), of one frame or more, not \(2, 3\)"),
        ({"pose": np.zeros((0, 1, 3)), "trans": np.zeros((0, 3))}, "of one frame or more"),
        ({"trans": np.zeros((3, 3))}, r"trans of 2 frames has the shape \(2, 3\), not \(3, 3\)"),
        ({"betas": np.zeros((2, 4))}, "betas are those of one person"),
        ({"expression": np.zeros((3, 4))}, r"expression of 2 frames has the shape \(2, E\)"),
        ({"trans": np.full((2, 3), np.nan)}, r"trans is nan at \[0, 0\]; leave such frames out"),
        ({"fps": 0.0}, "fps is a number above 0, not 0.0"),
        ({"fps": np.inf}, "fps is a number above 0"),
        ({"fps": True}, "fps is a number above 0"),
        ({"joint_names": ("a", "a"), "pose": np.zeros((2, 2, 3))}, "two joints are called a"),
        ({"bones": Bones((-1, 0), np.zeros((2, 3)))}, "the skeleton has 2 joints, and 1 have"),
    ],
)
def test_what_does_not_fit_together_is_refused(changed: dict[str, object], said: str) -> None:
    given = {"pose": np.zeros((2, 1, 3)), "trans": np.zeros((2, 3)), "fps": 10.0}
    with pytest.raises(BadArgument, match=said):
        Motion(**({"joint_names": ("root",)} | given | changed))  # type: ignore[arg-type]


def test_text_is_no_pose() -> None:
    with pytest.raises(NotNumbers, match="pose"):
        Motion("walk", np.zeros((1, 3)), 10.0, ("root",))  # type: ignore[arg-type]


@pytest.mark.parametrize("parents", [(0,), (-1, -1), (-1, 2, 1), (-1, 1)])
def test_bones_that_are_no_tree_are_refused(parents: tuple[int, ...]) -> None:
    with pytest.raises(BadArgument, match="each other joint comes after its parent"):
        Bones(parents, np.zeros((len(parents), 3)))


def test_slices_keep_the_frames_and_the_time() -> None:
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


def test_it_keeps_copies() -> None:
    pose, trans = np.zeros((2, 1, 3)), np.zeros((2, 3))
    motion = Motion(pose, trans, 10.0, ("root",))
    pose += 1
    assert not motion.pose.any()


@pytest.mark.parametrize("fps", [7.0, 10.0, 25.0, 100.0])
def test_a_constant_turn_is_resampled_exactly_through_half_a_turn(fps: float) -> None:
    """Slerp is the exact answer for it, also where rotation vectors jump from pi to -pi."""
    found, T = spinning(5.0, 10.0, 21).resampled(fps), int(2 * fps) + 1
    exact = spinning(5.0, fps, T)
    assert len(found) == T
    apart = Rotation.from_rotvec(found.pose[:, 0]).inv() * Rotation.from_rotvec(exact.pose[:, 0])
    assert apart.magnitude().max() < 1e-12
    np.testing.assert_allclose(found.trans, exact.trans, atol=1e-12)


def test_linear_rotation_vectors_would_fail_the_test_above() -> None:
    motion = spinning(5.0, 10.0, 21)
    at = np.linspace(0, 20, 41)
    lines = [np.interp(at, np.arange(21), motion.pose[:, 0, i]) for i in range(3)]
    exact = Rotation.from_rotvec(spinning(5.0, 20.0, 41).pose[:, 0])
    apart = exact.inv() * Rotation.from_rotvec(np.array(lines).T)
    assert apart.magnitude().max() > 1.0


def test_the_same_rate_and_back_change_nothing() -> None:
    motion = walk()
    assert np.array_equal(motion.resampled(motion.fps).pose, motion.pose)
    there = motion.resampled(3 * motion.fps)
    assert len(there) == 3 * (len(motion) - 1) + 1
    assert np.array_equal(there.resampled(motion.fps).pose, motion.pose)
    for wrong in (0.0, -1.0, np.nan, 1e12):
        with pytest.raises(BadArgument, match=r"fps is a number above 0|too many frames"):
            motion.resampled(wrong)


def test_turning_the_world_turns_the_surface_about_the_origin() -> None:
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


def test_it_plays_on_a_body_as_the_body_says() -> None:
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


def test_bones_of_a_person_move_as_the_body_s_joints() -> None:
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


def test_joints_go_by_their_names_and_what_is_left_over_is_said() -> None:
    motion = random_motion(52, (*BODY, *HANDS))
    here = motion.named(SMALL)
    assert np.array_equal(here.pose[:, :22], motion.pose[:, :22])
    assert not here.pose[:, 22:].any()
    said = " ".join(here.notes)
    assert "the motion lacks stay at rest: left_hand, right_hand" in said
    assert "the body lacks are left out: left_index1, left_index2" in said
    strange = Motion(np.zeros((1, 1, 3)), np.zeros((1, 3)), 10.0, ("tail",))
    with pytest.raises(BadArgument, match=r"the motion none of them but tail"):
        strange.vertices(SMALL)
    with pytest.raises(BadArgument, match="no bones of its own; give a body"):
        strange.joints()


def test_the_root_stays_where_it_was_when_another_body_plays_it() -> None:
    """Its own bones may rest elsewhere: trans differs by the difference of the roots at rest."""
    motion = walk()
    bones = bones_of(SMALL, motion.betas)
    moved = Bones(bones.parents, bones.offsets + np.eye(24, 1) * [0.1, 0.2, 0.3])
    given = Motion(motion.pose, motion.trans, 60.0, motion.joint_names, motion.betas, bones=moved)
    np.testing.assert_allclose(given.joints()[:, 0], given.joints(SMALL)[:, 0], atol=1e-12)


def test_gaps_are_filled_between_frames_and_left_out_at_the_ends() -> None:
    motion = spinning(2.0, 10.0, 12)
    pose, trans = motion.pose.copy(), motion.trans.copy()
    pose[[0, 4, 5, 11]] = np.nan
    trans[6] = np.nan
    found, places, expression, said = without_gaps(pose, trans)
    assert expression is None
    np.testing.assert_allclose(found, motion.pose[1:11], atol=1e-12)
    np.testing.assert_allclose(places, motion.trans[1:11], atol=1e-12)
    assert said == (
        "3 of 12 frames were not found, and are interpolated",
        "2 of 12 frames at the ends were not found, and are left out",
    )
    with pytest.raises(BadArgument, match="no frame of the motion is whole"):
        without_gaps(np.full((2, 1, 3), np.nan), np.zeros((2, 3)))


@pytest.mark.parametrize("axis", TURNS)
def test_the_axis_up_is_where_the_root_points(axis: str) -> None:
    motion = random_motion(1, ("root",), 40).turned(TURNS[axis].T)
    found, clear = motion.up
    assert found == axis
    assert clear > 0.9


def lengths_of(motion: Motion) -> Array:
    joints = motion.joints(SMALL)
    return np.linalg.norm(joints[:, 1:] - joints[:, list(SMALL.parents[1:])], axis=2)


def test_resampling_keeps_the_lengths_of_bones() -> None:
    """As no mean of places would: rotations are interpolated."""
    lengths = lengths_of(walk().resampled(47.0))
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-12)
