"""Limits of joints, of bodies and of hands: as shipped, as built, and what they mean in a fit."""

import json
from pathlib import Path

import numpy as np
import pytest

import workbench
from builder.joint_limits import anatomical
from builder.joint_limits import hand_limits as built
from builder.pose_priors import mirrored_pose
from workbench import Block, LevenbergMarquardt, Problem, load_body, residuals
from workbench.bodies import hand_motions, is_hand
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadArgument, BadBody, UnknownName
from workbench.fitting import usual_priors
from workbench.geometry.mirror import AXIAL, opposites
from workbench.priors.joint_limits import hand_limits, joint_limits

FOLDER = Path(workbench.__file__).parent / "data" / "joint_limits"
BODY = load_body("small")
POSE = BODY.blocks()[0]
NAMES = BODY.joint_names


def test_shipped_limits_are_what_the_builder_writes() -> None:
    assert json.loads((FOLDER / "anatomical.json").read_text()) == anatomical()


@pytest.mark.parametrize("name", ["anatomical", "recorded"])
def test_limits_have_sources_and_room(name: str) -> None:
    content = json.loads((FOLDER / f"{name}.json").read_text())
    assert content["sources"]
    assert content["unit"] == "degree"
    for row in content["limits"]:
        assert name == "recorded" or row["source"] in content["sources"]
        assert row["joint"] in NAMES
        if row["lower"] is not None and row["upper"] is not None:
            assert -181 < row["lower"] < row["upper"] < 181


def test_anatomical_limits_are_alike_on_both_sides() -> None:
    lower, upper = joint_limits("anatomical").bounds(POSE)
    joints = opposites(NAMES)
    np.testing.assert_array_equal(mirrored_pose(lower, joints)[:, 0], lower[:, 0])
    np.testing.assert_array_equal(mirrored_pose(lower, joints)[:, 1:], upper[:, 1:])
    assert (lower <= 0).all()  # the T-pose itself is allowed
    assert (upper >= 0).all()


def moved(joint: str, axis: int, angle: float, seen: str) -> np.ndarray:
    """How far a joint moves from the T-pose when another turns about one axis."""
    pose = np.zeros((24, 3))
    pose[NAMES.index(joint), axis] = angle
    return (BODY.joints(pose=pose) - BODY.joints())[NAMES.index(seen)]


SIDES: list[tuple[str, int, int, str, list[float]]] = [
    ("left_hip", 0, 0, "left_knee", [0, 0, 1]),  # flexion: the knee comes forward
    ("right_hip", 0, 0, "right_knee", [0, 0, 1]),
    ("left_hip", 2, 1, "left_knee", [1, 0, 0]),  # abduction: outwards
    ("right_hip", 2, 0, "right_knee", [-1, 0, 0]),
    ("left_hip", 1, 0, "left_foot", [-1, 0, 0]),  # medial rotation: the toes turn in
    ("left_knee", 0, 1, "left_ankle", [0, 0, -1]),  # flexion: the ankle goes back
    ("left_ankle", 0, 0, "left_foot", [0, 1, 0]),  # dorsiflexion: the toes go up
    ("left_elbow", 1, 0, "left_wrist", [0, 0, 1]),  # flexion: the wrist comes forward
    ("right_elbow", 1, 1, "right_wrist", [0, 0, 1]),
    ("left_shoulder", 2, 1, "left_elbow", [0, 1, 0]),  # abduction: the arm goes up
    ("right_shoulder", 2, 0, "right_elbow", [0, 1, 0]),
    ("left_wrist", 2, 0, "left_hand", [0, -1, 0]),  # flexion: the palm goes down
    ("left_wrist", 1, 0, "left_hand", [0, 0, 1]),  # radial deviation: towards the thumb
]


def test_limits_are_on_the_side_of_their_motion() -> None:
    for joint, axis, end, seen, direction in SIDES:
        limit = joint_limits("anatomical").limits[joint, axis][end]
        away = moved(joint, axis, np.sign(limit) * 0.3, seen)
        assert away @ direction > 0.5 * np.linalg.norm(away) > 0


def test_limits_are_bounds_of_a_pose() -> None:
    limits = joint_limits("anatomical")
    lower, upper = limits.bounds(POSE)
    assert lower[NAMES.index("left_knee"), 0] == 0
    assert upper[NAMES.index("left_knee"), 0] == pytest.approx(np.radians(130))
    assert np.isinf(lower[NAMES.index("spine1")]).all()
    other = Block("his pose", (2, 3), "rad", ("tail", "left_knee"))
    assert limits.bounds(other)[0][1, 0] == 0
    for block, message in (
        (Block("pose", (24, 3)), "whose rows are labelled with names of joints"),
        (BODY.blocks()[1], "is no pose"),
        (Block("tails", (1, 3), "rad", ("tail",)), "no joint of block 'tails' is among those"),
    ):
        with pytest.raises(BadArgument, match=message):
            limits.bounds(block)
    with pytest.raises(UnknownName, match="no set of joint limits is called 'canine'; there are"):
        joint_limits("canine")


def test_limits_keep_knees_from_bending_backwards() -> None:
    """The joints of a body whose left knee bends the wrong way, with the limits and without."""
    backwards = np.zeros((24, 3))
    backwards[NAMES.index("left_knee"), 0] = -0.6
    symbols = [block.symbol for block in BODY.blocks()]
    observed = Block("observed", (24, 3), "m")
    terms = (
        residuals.landmarks(BODY.joint_points(*symbols), observed.symbol, sigma=0.01),
        residuals.gaussian(symbols[0], covariance=1.0),
    )
    start = BODY.start() | {"observed": BODY.joints(pose=backwards)}
    poses = {}
    for limits in (None, {"pose": joint_limits().bounds(POSE)}):
        solution = LevenbergMarquardt().solve(Problem(terms, ("pose",), limits), start)
        assert solution.converged
        poses[limits is None] = solution.values["pose"][NAMES.index("left_knee"), 0]
    assert poses[True] < -0.4
    assert poses[False] >= 0


HAND, LEFT = load_skinned("hand"), load_skinned("hand-left")
LIMITS = hand_limits()


def turned(joint: str, motion: str, angle: float) -> np.ndarray:
    """The pose in which a joint has made one motion from rest."""
    (axis,) = (m.axis for m in hand_motions(HAND) if (m.joint, m.motion) == (joint, motion))
    pose = np.zeros((16, 3))
    pose[HAND.joint_names.index(joint)] = angle * axis
    return pose


def test_shipped_hand_limits_are_what_the_builder_writes() -> None:
    content = json.loads((FOLDER / "hand.json").read_text())
    assert content == built()
    for row in content["limits"]:
        assert row["source"] in content["sources"]
        assert row["lower"] < row["upper"]


def test_axes_of_hands_are_orthogonal_and_mirrored() -> None:
    right, left = hand_motions(HAND), hand_motions(LEFT)
    assert len(right) == 45
    for i in range(0, 45, 3):
        axes = np.array([motion.axis for motion in right[i : i + 3]])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    for one, other in zip(right, left, strict=True):
        assert (one.joint, one.motion) == (other.joint, other.motion)
        sign = -1.0 if one.motion == "twist" else 1.0  # a mirror reverses a twist
        np.testing.assert_allclose(other.axis, sign * one.axis * AXIAL, atol=1e-12)
        assert other.at_rest == pytest.approx(one.at_rest, abs=1e-12)


def test_motions_of_hands_go_where_named() -> None:
    at = dict(zip(HAND.joint_names, range(16), strict=True))
    rest = HAND.joints()
    bent = HAND.joints(turned("index1", "flexion", 0.5)) - rest
    assert bent[at["index2"], 1] < -0.01  # the palm is down
    aside = HAND.joints(turned("pinky1", "radial deviation", 0.3)) - rest
    assert aside[at["pinky2"], 2] > 0.003  # the thumb is in front
    away = HAND.joints(turned("thumb1", "palmar abduction", 0.3)) - rest
    assert away[at["thumb2"], 1] < -0.003
    twisted = HAND.joints(turned("ring2", "twist", 1.0)) - rest
    assert np.abs(twisted).max() < 1e-9
    tips = HAND.landmark("tips", turned("thumb3", "flexion", 0.8))
    pinky = rest[at["pinky1"]]
    assert np.linalg.norm(tips[4] - pinky) < np.linalg.norm(HAND.landmark("tips")[4] - pinky)


@pytest.mark.parametrize("body", [HAND, LEFT], ids=lambda body: body.name)
def test_backward_bends_are_beyond_limits(body: workbench.SkinnedBody) -> None:
    term = LIMITS.residual(body, sigma=0.1)
    problem = Problem([term], ("pose",))
    assert not problem.linearize({"pose": np.zeros((16, 3))}).residual.any()
    (axis,) = (m.axis for m in hand_motions(body) if m.joint == "index2" and m.motion == "flexion")
    pose = np.zeros((16, 3))
    pose[body.joint_names.index("index2")] = -0.3 * axis
    beyond = 0.1 * problem.linearize({"pose": pose}).residual
    assert beyond.min() == pytest.approx(-0.3)
    assert np.count_nonzero(beyond) == 1
    assert term.label(int(beyond.argmin())) == "hand limits[index2, flexion]"


def test_only_hands_have_hand_limits() -> None:
    assert [term.name for term in usual_priors(HAND)] == [
        "pose prior",
        "shape prior",
        "hand limits",
    ]
    person = load_skinned("small")
    assert len(usual_priors(person)) == 2
    assert is_hand(LEFT)
    assert not is_hand(person)
    with pytest.raises(BadBody, match="has no hand"):
        LIMITS.residual(person)
    with pytest.raises(BadBody, match="no joints left_wrist"):
        hand_motions(HAND, "left_")
