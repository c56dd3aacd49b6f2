"""Fits of a hand to 16 or 21 points: the truth is found, and what cannot be used is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench as wb
from builder.hands.poses import HandPoses
from workbench.bodies import HAND_POINTS, pose_space
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadBody
from workbench.fitting import BadObservation, hand_fit, hand_problem, hand_start, pose_prior
from workbench.fitting.body_priors import BESIDE, pose_gaussian
from workbench.fitting.hand_fit import points_of

HAND = load_skinned("hand")
NOISE = 0.002  # m
NAMES = ("pose", "betas", "trans")


def drawn(count: int, seed: int) -> list[wb.Values]:
    """Hands in poses that nothing was learned from, turned any way."""
    rng = np.random.default_rng(seed)
    poses = HandPoses(HAND.joints(), HAND.landmark("tips")).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    return [
        {"pose": pose, "betas": rng.standard_normal(10), "trans": rng.standard_normal(3)}
        for pose in poses
    ]


def surface(values: wb.Values) -> np.ndarray:
    return HAND.vertices(*(values[name] for name in NAMES))


def test_twenty_one_noisy_points_find_a_hand_within_two_millimetres() -> None:
    problem, rng = hand_problem(HAND), np.random.default_rng(8)
    medians, means = [], []
    for truth in drawn(12, 7):
        seen = points_of(HAND, truth) + NOISE * rng.standard_normal((21, 3))
        solution = wb.solve(problem, hand_start(HAND, seen))
        assert solution.converged
        off = 1e3 * np.linalg.norm(surface(solution.values) - surface(truth), axis=1)
        medians.append(np.median(off))
        means.append(off.mean())
    assert np.median(medians) < 2.3  # 2 in the mean over 100 hands
    assert max(means) < 6


def test_joints_alone_are_the_same_problem_with_tips_that_do_not_count() -> None:
    (truth,) = drawn(1, 9)
    setup = hand_fit(HAND, HAND.joints(*(truth[name] for name in NAMES)), truth=surface(truth))
    assert setup.start["seen"].sum() == 16
    found = wb.solve(setup.problem, setup.start)
    measured = {m.name: m.value for m in setup.measures(setup.start | found.values)}
    assert measured["distance of 16 points, rms"] < 1
    assert measured["vertex to truth, median"] < 2
    assert setup.priors == ("pose prior", "shape prior", "hand limits")


def test_points_that_were_not_seen_do_not_count() -> None:
    (truth,) = drawn(1, 11)
    seen = points_of(HAND, truth)
    wrong = seen.copy()
    seen[5] = np.nan
    start = hand_start(HAND, seen)
    wrong[5] = 7.0
    assert start["seen"][5] == 0
    problem = hand_problem(HAND)
    moved = start | {"observed": wrong}
    np.testing.assert_allclose(problem.linearize(start).cost, problem.linearize(moved).cost)


def test_what_no_hand_is_placed_by_is_refused() -> None:
    with pytest.raises(BadObservation, match=r"\(21, 3\) in the order"):
        hand_start(HAND, np.zeros((20, 3)))
    few = np.full((21, 3), np.nan)
    few[:2] = 0.0
    with pytest.raises(BadObservation, match="2 points of a hand are known"):
        hand_start(HAND, few)
    with pytest.raises(BadBody, match="'small' is no hand"):
        hand_problem(load_skinned("small"))


def test_the_prior_on_a_hands_pose_is_that_of_its_pose_space() -> None:
    mean, covariance = pose_gaussian(HAND)
    space = pose_space(HAND)
    np.testing.assert_allclose(mean, space.mean)
    sizes = np.sqrt(np.linalg.eigvalsh(covariance)[::-1][:10] - BESIDE**2)
    np.testing.assert_allclose(sizes, space.deviations[:10], rtol=1e-3)
    problem = wb.Problem([pose_prior(HAND)], ("pose",))
    along = space.poses(HAND, np.concatenate([space.deviations[:1], np.zeros(44)]))
    cost = problem.linearize({"pose": along}).cost
    expected = 0.5 * space.deviations[0] ** 2 / (space.deviations[0] ** 2 + BESIDE**2)
    assert cost == pytest.approx(expected, rel=1e-3)


def test_the_order_of_21_points_is_by_finger() -> None:
    (truth,) = drawn(1, 13)
    found = points_of(HAND, truth)
    joints = HAND.joints(*(truth[name] for name in NAMES))
    for name, place in zip(HAND.joint_names, joints, strict=True):
        np.testing.assert_array_equal(found[HAND_POINTS.index(name)], place)
