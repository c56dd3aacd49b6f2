"""The embedded hands: what must be true of their arrays, their mirror, their pose space, points."""

import casadi as cs
import numpy as np

import workbench as wb
from workbench.blocks import Block
from workbench.bodies import HAND_POINTS, hand_points, pose_space
from workbench.bodies.catalogue import load_skinned
from workbench.geometry.mirror import AXIAL, REFLECTION
from workbench.residuals import landmarks

HAND, LEFT = load_skinned("hand"), load_skinned("hand-left")
SPACE = pose_space(HAND)


def someone(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A pose of the pose space with a turned wrist, a shape and a place."""
    rng = np.random.default_rng(seed)
    pose = SPACE.poses(HAND, SPACE.deviations * rng.standard_normal(45))
    pose[0] = rng.standard_normal(3)
    return pose, rng.standard_normal(10), rng.standard_normal(3)


def mean_pose() -> dict[str, np.ndarray]:
    return {
        "pose": SPACE.poses(HAND, np.zeros(45)),
        "betas": np.zeros(10),
        "trans": np.zeros(3),
    }


# The left hand.


def test_left_hand_is_the_right_one_mirrored() -> None:
    pose, betas, trans = someone()
    right = HAND.vertices(pose, betas, trans)
    left = LEFT.vertices(pose * AXIAL, betas, trans * REFLECTION)
    np.testing.assert_allclose(left * REFLECTION, right, atol=1e-12)
    joints = LEFT.joints(pose * AXIAL, betas, trans * REFLECTION)
    np.testing.assert_allclose(joints * REFLECTION, HAND.joints(pose, betas, trans), atol=1e-12)


# The pose space.


def test_hand_is_posed_by_coefficients() -> None:
    few = SPACE.first(5)
    z, wrist, (_, betas, trans) = few.block(), Block("wrist", (1, 3), "rad"), HAND.blocks()
    pose = few.pose(HAND, z.symbol, wrist.symbol)
    points = HAND.points(pose, betas.symbol, trans.symbol, vertices=[3, 500])
    assert points.source.numeric is not None  # it is affine, so that there is fast arithmetic
    rng = np.random.default_rng(2)
    values = {
        "coefficients": rng.standard_normal(5),
        "wrist": rng.standard_normal((1, 3)),
        "betas": rng.standard_normal(10),
        "trans": rng.standard_normal(3),
    }
    whole = few.poses(HAND, values["coefficients"])
    whole[0] = values["wrist"][0]
    expected = HAND.vertices(whole, values["betas"], values["trans"])[[3, 500]]
    np.testing.assert_allclose(points.source.numeric.evaluate(values).points, expected, atol=1e-12)


# Joints and finger tips together.


def test_21_points_are_joints_and_tips() -> None:
    pose, betas, trans = someone(4)
    values = {"pose": pose, "betas": betas, "trans": trans}
    points = hand_points(HAND, *(block.symbol for block in HAND.blocks()))
    assert points.labels == HAND_POINTS
    numeric = points.source.numeric
    assert numeric is not None
    names = [*HAND.joint_names, *HAND.landmark_names("tips")]
    own = np.concatenate([HAND.joints(pose, betas, trans), HAND.landmark("tips", **values)])
    expected = own[[names.index(name) for name in HAND_POINTS]]
    np.testing.assert_allclose(numeric.evaluate(values).points, expected, atol=1e-12)
    graph = cs.Function("f", [b.symbol for b in HAND.blocks()], [points.graph()])
    np.testing.assert_allclose(np.asarray(graph(pose.T, betas, trans)).T, expected, atol=1e-12)
    batch = {name: np.stack([value, value]) for name, value in values.items()}
    np.testing.assert_allclose(numeric.evaluate_batch(batch)[1], expected, atol=1e-12)


def test_finger_tips_raise_the_rank_to_38() -> None:
    at = [block.symbol for block in HAND.blocks()]
    seen = landmarks(hand_points(HAND, *at), np.zeros((21, 3)), sigma=0.002)
    found = wb.diagnose(wb.Problem([seen], free=["pose"]), mean_pose())
    assert found.rank == 38
    names = [direction.name for direction in found.null_directions]
    for finger in ("index", "middle", "pinky", "ring", "thumb"):
        assert f"a turn of pose[{finger}2], undone at {finger}3" in names
        assert any(name.startswith(f"turns from {finger}1 down") for name in names)
