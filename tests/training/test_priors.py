"""Priors of training, on templates by edges and on poses: their costs, slopes and curvature."""

from dataclasses import replace

import numpy as np
import pytest

from tests.training.test_symbolic import BODY, ESTIMATE, OBJECTIVE, START
from workbench.fitting import pose_prior
from workbench.fitting.body_priors import pose_gaussian
from workbench.problem import Problem
from workbench.training.normal_equations import NormalEquations
from workbench.training.priors import PosePrior, smooth_prior
from workbench.training.registrations import InMemory
from workbench.training.symbolic import SymbolicTraining

PRIOR = smooth_prior(START.faces, BODY.shapedirs, 0.01)
RNG = np.random.default_rng(5)
N = len(START.template)


def test_precision_is_the_inverse_of_the_covariance() -> None:
    some = RNG.standard_normal((4, N, 3))
    expected = np.linalg.solve(PRIOR.covariance(), some.reshape(4, -1).T).T
    np.testing.assert_allclose(
        PRIOR.precision_product(some).reshape(4, -1), expected, rtol=1e-7, atol=1e-6
    )


def test_betas_cost_what_a_standard_normal_costs() -> None:
    """Along a shape direction the cost is at most betas^2 / 2, whatever the edges would say."""
    for k in range(BODY.n_betas):
        d = BODY.shapedirs[None, :, :, k]
        assert 0 < np.vdot(d, PRIOR.precision_product(d)) <= 1


HELD = replace(OBJECTIVE, freedom=PRIOR, first_posedirs=BODY.posedirs + 0.001)


@pytest.mark.parametrize("term", ["E_T", "E_P"])
def test_terms_are_those_of_the_symbols(term: str) -> None:
    symbolic = SymbolicTraining.of(BODY, HELD)
    cost = symbolic.problem([term]).linearize(symbolic.values(ESTIMATE)).cost
    assert cost == pytest.approx(HELD.costs(ESTIMATE)[term], rel=1e-8)


def matrices(count: int) -> np.ndarray:
    """Symmetric (count, N, 3, 3) with eigenvalues from 0 to 1."""
    Q, _ = np.linalg.qr(RNG.standard_normal((count, N, 3, 3)))
    return np.asarray(np.einsum("jnab,jnb,jncb->jnac", Q, RNG.uniform(0, 1, (count, N, 3)), Q))


BATCH = OBJECTIVE.registrations.read(slice(0, len(OBJECTIVE.registrations.subject)))
SOFT = replace(
    HELD, registrations=InMemory(BATCH.vertices, BATCH.subject, matrices(len(BATCH.subject)))
)


@pytest.mark.parametrize("name", ["templates", "poses"])
def test_slope_with_directed_confidence_is_that_of_the_cost(name: str) -> None:
    slope = NormalEquations(SOFT, ESTIMATE, (name,)).negative_gradient[name]
    change = {name: RNG.standard_normal(slope.shape)}
    h = 1e-6
    ahead, behind = (SOFT.cost(ESTIMATE.moved(change, s * h)) for s in (1, -1))
    assert (behind - ahead) / (2 * h) == pytest.approx(np.vdot(slope, change[name]), rel=1e-5)


PRIOR_RNG = np.random.default_rng(2)
POSES = 3 * (BODY.n_joints - 1)
MIXED = PRIOR_RNG.standard_normal((POSES, POSES)) / 4
POSE_PRIOR = PosePrior.of(
    0.1 * PRIOR_RNG.standard_normal((POSES // 3, 3)), MIXED @ MIXED.T + np.eye(POSES)
)
PRIOR_HELD = replace(OBJECTIVE, pose_prior=POSE_PRIOR)


def test_pose_prior_costs_its_residual() -> None:
    prior = PosePrior.of(*pose_gaussian(BODY))
    problem = Problem([pose_prior(BODY)], ["pose"])
    for pose, cost in zip(ESTIMATE.poses, prior.costs(ESTIMATE.poses), strict=True):
        assert problem.linearize({"pose": pose}).cost == pytest.approx(cost, rel=1e-12)


def test_objective_has_the_pose_prior_and_its_slope() -> None:
    costs = PRIOR_HELD.costs(ESTIMATE)
    assert costs.keys() - OBJECTIVE.costs(ESTIMATE).keys() == {"E_pose"}
    names = ("templates", "joints", "poses")
    slope, h = NormalEquations(PRIOR_HELD, ESTIMATE, names).negative_gradient, 1e-6
    turn = ESTIMATE.zero_change(names)
    turn["poses"] = PRIOR_RNG.standard_normal(ESTIMATE.poses.shape)
    ahead, behind = (PRIOR_HELD.cost(ESTIMATE.moved(turn, s * h)) for s in (1.0, -1.0))
    assert np.vdot(slope["poses"], turn["poses"]) == pytest.approx(
        (behind - ahead) / (2 * h), rel=1e-5
    )
