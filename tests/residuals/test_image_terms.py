"""The terms of fits to images: exact values, bounds between forms, signs by bending a body."""

import numpy as np
import pytest

from tests.differences import assert_hessian, assert_jacobian
from tests.tiers import few
from workbench import Block, Problem, load_body, residuals
from workbench.errors import BadResidual
from workbench.residuals import HINGES, Residual

RNG = np.random.default_rng(0)
SHARES, MEANS = np.array([0.5, 0.3, 0.2]), RNG.normal(size=(3, 4))
FACTORS = 0.5 * RNG.normal(size=(3, 4, 4)) + 0.8 * np.eye(4)
COVARIANCES = FACTORS @ FACTORS.swapaxes(1, 2)
X = Block("x", (4,))


def problem_of(residual: Residual) -> Problem:
    return Problem([residual], residual.reads)


def cost(residual: Residual, x: np.ndarray) -> float:
    r = problem_of(residual).residual(x, np.zeros(0))
    return 0.5 * float(r @ r)


def energies(x: np.ndarray) -> np.ndarray:
    """e_j, from the densities' own formula."""
    costs = []
    for g, mu, C in zip(SHARES, MEANS, COVARIANCES, strict=True):
        d = x - mu
        squared = d @ np.linalg.solve(C, d)
        costs.append(0.5 * squared + 0.5 * np.log(np.linalg.det(C)) - np.log(g))
    return np.array(costs)


def mixture() -> Residual:
    return residuals.max_mixture(X.symbol, shares=SHARES, means=MEANS, covariances=COVARIANCES)


def test_mixture_cost_matches_its_formula() -> None:
    c = np.array([0.5 * np.log(np.linalg.det(C)) for C in COVARIANCES]) - np.log(SHARES)
    for seed in range(2):
        x = 2 * np.random.default_rng(seed).normal(size=4)
        assert cost(mixture(), x) == pytest.approx(energies(x).min() - c.min(), rel=1e-12)


@pytest.mark.thorough
def test_derivatives_of_mixtures() -> None:
    problem = problem_of(mixture())
    for seed in range(2):
        x = np.random.default_rng(seed).normal(size=4)
        assert_jacobian(problem, x, np.zeros(0), 1e-7)
        assert_hessian(problem, x, np.zeros(0), 1e-7)


def test_equal_components_count_once() -> None:
    """Exactly between two mirrored components, whose e_j are the same number."""
    x = Block("x", (2,))
    pair = residuals.max_mixture(
        x.symbol, shares=[1, 1], means=[[1, 0], [-1, 0]], covariances=[np.eye(2), np.eye(2)]
    )
    assert cost(pair, np.zeros(2)) == pytest.approx(0.5)


def test_mixture_of_one_is_gaussian() -> None:
    one = {"shares": [2.0], "means": MEANS[:1], "covariances": COVARIANCES[:1]}
    plain = residuals.gaussian(X.symbol, mean=MEANS[0], covariance=COVARIANCES[0])
    x = RNG.normal(size=4)
    single = residuals.max_mixture(X.symbol, **one)
    assert cost(single, x) == pytest.approx(cost(plain, x), rel=1e-12)
    assert problem_of(single).linearize({"x": x}).finite


def test_bad_mixtures_are_refused() -> None:
    fine = {"shares": SHARES, "means": MEANS, "covariances": COVARIANCES}
    for wrong in (
        {"shares": [0.5, 0.5, 0.0]},
        {"means": MEANS[:2]},
        {"covariances": COVARIANCES[:, :3, :3]},
        {"covariances": -COVARIANCES},
    ):
        with pytest.raises(BadResidual):
            residuals.max_mixture(X.symbol, **fine | wrong)


# Elbows and knees.


@pytest.mark.parametrize("joint", few(HINGES, 2))
def test_bending_grows_where_a_joint_bends_backwards(joint: str) -> None:
    """The table of signs, by the body itself: a wrist forwards and an ankle backwards are
    natural, for a body that faces +z."""
    body = load_body("small")
    pose = body.blocks()[0]
    term = residuals.bending(pose)
    row = list(HINGES).index(joint)
    hinge = HINGES[joint]

    def bent(angle: float) -> np.ndarray:
        values = np.zeros((24, 3))
        values[body.joint_names.index(joint), hinge.axis] = angle
        return values

    def value(angle: float) -> float:
        return float(problem_of(term).residual(bent(angle).ravel(), np.zeros(0))[row])

    angles = np.linspace(-1.5, 1.5, 7)
    towards = np.array([value(hinge.backwards * a) for a in angles])
    assert (np.diff(towards) > 0).all()
    assert value(0.0) == pytest.approx(1.0)
    end = joint.replace("elbow", "wrist").replace("knee", "ankle")
    place = body.joint_names.index(end)
    natural = body.joints(pose=bent(-1.0 * hinge.backwards))[place]
    straight = body.joints(pose=bent(0.0))[place]
    forwards = natural[2] - straight[2]
    assert forwards > 0.05 if "elbow" in joint else forwards < -0.05


def test_bending_cost_matches_its_formula() -> None:
    pose = load_body("small").blocks()[0]
    values = np.random.default_rng(2).normal(size=(24, 3))
    expected = 0.5 * sum(
        np.exp(2 * h.backwards * values[pose.labels.index(j), h.axis]) for j, h in HINGES.items()
    )
    assert cost(residuals.bending(pose), values.ravel()) == pytest.approx(expected, rel=1e-12)
    assert_jacobian(problem_of(residuals.bending(pose)), values.ravel(), np.zeros(0), 1e-8)


def test_bending_needs_a_pose_with_such_joints() -> None:
    with pytest.raises(BadResidual, match="no pose"):
        residuals.bending(Block("betas", (10,)))
    with pytest.raises(BadResidual, match="none of them"):
        residuals.bending(Block("pose", (2, 3), "rad", ("root", "tail")))


# Limits.


def test_limits_count_only_outside() -> None:
    x = Block("x", (4,), "rad")
    term = residuals.limits(x, [-1, -1, -np.inf, -1], [1, 1, np.inf, np.inf], sigma=0.1)
    assert term.size == 3
    r = problem_of(term).residual(np.array([0.5, -1.2, 50.0, 70.0]), np.zeros(0))
    np.testing.assert_allclose(r, [0, -2.0, 0], atol=1e-12)
    assert term.label(2) == "limits(x)[3]"
    for low, high in ((1.0, -1.0), (np.nan, 1.0), (-np.inf, np.inf)):
        with pytest.raises(BadResidual):
            residuals.limits(x, low, high, sigma=0.1)
