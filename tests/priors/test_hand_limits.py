"""Limits of a hand's joints: the shipped file, what its motions are, and what they do in a fit."""

import json
from pathlib import Path

import numpy as np
import pytest

import workbench
from builder.hands.sets import HandPoses
from builder.joint_limits import hand_limits as built
from workbench import Problem, residuals
from workbench.blocks import Block
from workbench.bodies import hand_motions, is_hand
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadBody, BadResidual
from workbench.fitting import usual_priors
from workbench.geometry.mirror import AXIAL
from workbench.priors.joint_limits import hand_limits

FILE = Path(workbench.__file__).parent / "data" / "joint_limits" / "hand.json"
HAND, LEFT = load_skinned("hand"), load_skinned("hand-left")
LIMITS = hand_limits()


def turned(joint: str, motion: str, angle: float) -> np.ndarray:
    """The pose in which a joint has made one motion from rest."""
    (axis,) = (m.axis for m in hand_motions(HAND) if (m.joint, m.motion) == (joint, motion))
    pose = np.zeros((16, 3))
    pose[HAND.joint_names.index(joint)] = angle * axis
    return pose


def test_shipped_hand_limits_are_what_the_builder_writes() -> None:
    content = json.loads(FILE.read_text())
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
    assert not LIMITS.beyond(body, np.zeros((16, 3))).any()
    (axis,) = (m.axis for m in hand_motions(body) if m.joint == "index2" and m.motion == "flexion")
    pose = np.zeros((16, 3))
    pose[body.joint_names.index("index2")] = -0.3 * axis
    term = LIMITS.residual(body, sigma=0.1)
    problem = Problem([term], ("pose",))
    beyond = LIMITS.beyond(body, pose)
    assert beyond.min() == pytest.approx(-0.3)
    assert np.count_nonzero(beyond) == 1
    found = problem.linearize({"pose": pose})
    np.testing.assert_allclose(found.residual * 0.1, beyond, atol=1e-12)
    assert term.label(int(beyond.argmin())) == "hand limits[index2, flexion]"


def test_training_poses_are_mostly_within_limits() -> None:
    poses = HandPoses(HAND.joints(), HAND.landmark("tips")).draw(2000, np.random.default_rng(5))
    beyond = np.abs(LIMITS.beyond(HAND, poses))
    assert beyond.shape == (2000, 43)
    assert np.count_nonzero(beyond) <= 10
    assert np.degrees(beyond.max()) < 5


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


def test_limits_of_expressions_name_what_is_beyond() -> None:
    x = Block("x", (2,))
    term = residuals.limits(
        2 * x.symbol, [-1, -np.inf], [1, np.inf], sigma=0.5, unit="rad", labels=("first", "second")
    )
    assert (term.size, term.unit, term.labels) == (1, "rad", ("first",))
    found = Problem([term], ("x",)).linearize({"x": np.array([2.0, 9.0])})
    np.testing.assert_allclose(found.residual, [(4 - 1) / 0.5])
    with pytest.raises(BadResidual, match="a column"):
        residuals.limits(x.symbol.T, -1, 1, sigma=1, labels=("first", "second"))
    with pytest.raises(BadResidual, match="second has the lower limit 2"):
        residuals.limits(x.symbol, [0, 2], [1, 1], sigma=1, labels=("first", "second"))
