"""E_pose and its derivatives by turns of the joints."""

from dataclasses import replace

import numpy as np
import pytest

from tests.training.test_symbolic_form import BODY, ESTIMATE, OBJECTIVE
from workbench.fitting import pose_prior
from workbench.fitting.body_priors import pose_gaussian
from workbench.geometry.rotation import matrix_from_vector, slopes_by_turns, vector_from_matrix
from workbench.problem import Problem
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.normal_equations import NormalEquations
from workbench.training.pose_prior import PosePrior

RNG = np.random.default_rng(2)
N = 3 * (BODY.n_joints - 1)
MIXED = RNG.standard_normal((N, N)) / 4
PRIOR = PosePrior.of(0.1 * RNG.standard_normal((N // 3, 3)), MIXED @ MIXED.T + np.eye(N))
HELD = replace(OBJECTIVE, pose_prior=PRIOR)


@pytest.mark.parametrize("size", [0.0, 1e-4, 9.9e-3, 1.01e-2, 0.5, 3.0])
def test_rotation_vectors_move_with_turns_as_differences_say(size: float) -> None:
    w = RNG.standard_normal((7, 3))
    w *= size / np.linalg.norm(w, axis=1)[:, None]
    h = 1e-5
    for axis in np.eye(3):
        ends = [
            vector_from_matrix(matrix_from_vector(s * h * np.tile(axis, (7, 1))) @ there)
            for s in (1, -1)
            for there in [matrix_from_vector(w)]
        ]
        expected = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(slopes_by_turns(w) @ axis, expected, atol=2e-8)


def test_the_cost_is_that_of_the_residual() -> None:
    prior = PosePrior.of(*pose_gaussian(BODY))
    problem = Problem([pose_prior(BODY)], ["pose"])
    for pose, cost in zip(ESTIMATE.poses, prior.costs(ESTIMATE.poses), strict=True):
        assert problem.linearize({"pose": pose}).cost == pytest.approx(cost, rel=1e-12)


def test_the_slope_is_that_of_the_cost() -> None:
    turn = ESTIMATE.zero_change(("poses",))
    turn["poses"] = RNG.standard_normal(ESTIMATE.poses.shape)
    h = 1e-5
    ahead, behind = (
        float(PRIOR.costs(ESTIMATE.moved(turn, s * h).poses).sum()) for s in (1.0, -1.0)
    )
    slope = PRIOR.slope(ESTIMATE.poses)
    assert np.vdot(slope, turn["poses"]) == pytest.approx((behind - ahead) / (2 * h), rel=1e-7)


def test_the_curvature_is_symmetric_and_the_blocks_are_its_own() -> None:
    a, b = (RNG.standard_normal(ESTIMATE.poses.shape) for _ in range(2))
    poses = ESTIMATE.poses
    assert np.vdot(a, PRIOR.curved(poses, b)) == pytest.approx(np.vdot(b, PRIOR.curved(poses, a)))
    flat = (PRIOR.blocks(poses) @ a.reshape(len(a), -1, 1)).reshape(a.shape)
    np.testing.assert_allclose(flat, PRIOR.curved(poses, a), atol=1e-12)


def test_the_objective_has_the_term_and_its_slope() -> None:
    costs = HELD.costs(ESTIMATE)
    assert costs.keys() - OBJECTIVE.costs(ESTIMATE).keys() == {"E_pose"}
    names = ("templates", "joints", "poses")
    slope, h = NormalEquations(HELD, ESTIMATE, names).slope, 1e-6
    turn = ESTIMATE.zero_change(names)
    turn["poses"] = RNG.standard_normal(ESTIMATE.poses.shape)
    ahead, behind = (HELD.cost(ESTIMATE.moved(turn, s * h)) for s in (1.0, -1.0))
    assert np.vdot(slope["poses"], turn["poses"]) == pytest.approx(
        (behind - ahead) / (2 * h), rel=1e-5
    )


def test_people_lower_the_cost_with_a_prior_on_poses() -> None:
    given = BlockInput(HELD, BODY.faces)
    found = BLOCKS["people"](given, ESTIMATE)
    assert HELD.cost(found.estimate) < HELD.cost(ESTIMATE)
    assert found.facts["steps"] > 0
