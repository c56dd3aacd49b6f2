"""Rotation vectors beyond half a turn."""

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench import SOLVERS, Block, Constraint, LevenbergMarquardt, Problem, residuals
from workbench.geometry.rotation import matrix_from_vector, wrapped_to_pi
from workbench.solvers.judgement import rewrapped

RNG = np.random.default_rng(0)
BODY = random_body(3, n_vertices=15, n_joints=3, n_betas=2)
SYMBOLS = [block.symbol for block in BODY.blocks()]
SLOW = ("steepest-descent", "nlopt-bobyqa", "nlopt-mma", "nlopt-ccsaq", "nlopt-mlsl")
OBSERVED = Block("observed", (15, 3), "m").symbol
DATA = residuals.vertices(BODY.points(*SYMBOLS), OBSERVED, sigma=0.02)
LONG = np.array([[0.1, 0.2, 0.3], [4.0, 0.0, 0.5], [0.0, -7.0, 0.2]])


@pytest.mark.parametrize("angle", [0.0, 1.0, 3.1, 3.2, 6.2831, 40.0])
def test_the_shortest_vector_is_the_same_rotation(angle: float) -> None:
    axes = RNG.normal(size=(5, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    short = wrapped_to_pi(angle * axes)
    assert (np.linalg.norm(short, axis=1) <= np.pi * (1 + 1e-12)).all()
    for before, after in zip(angle * axes, short, strict=True):
        np.testing.assert_allclose(
            matrix_from_vector(after), matrix_from_vector(before), atol=1e-13 * max(1, angle)
        )
    if angle <= np.pi:
        np.testing.assert_array_equal(short, angle * axes)


def problem(*priors, bounds=None) -> Problem:
    return Problem((DATA, *priors), ("pose", "trans"), bounds)


def at(pose: np.ndarray) -> dict:
    return BODY.start() | {"pose": pose, "observed": BODY.vertices(pose=LONG)}


def test_bounds_forbid_what_they_forbid() -> None:
    lower, upper = np.full((3, 3), -10.0), np.full((3, 3), 10.0)
    lower[1, 0] = 3.5  # where the shorter vector is not
    case = problem(bounds={"pose": (lower, upper)})
    x, _ = case.split(at(LONG))
    pose = case.free.unpack(rewrapped(case, x, lambda _: True))["pose"]
    np.testing.assert_array_equal(pose[1], LONG[1])
    assert np.linalg.norm(pose[2]) < np.pi


@pytest.mark.parametrize(
    "name",
    few(
        [name for name in SOLVERS if name not in SLOW],
        ("trust-region", "dogleg", "newton", "ipopt", "nlopt-lbfgs"),
    ),
)
@pytest.mark.parametrize("off", few([0.01, 0.03], 1))
def test_solutions_wrap_rotations_to_pi(name: str, off: float) -> None:
    """From near the answer in its long form: the same cost, in the short form."""
    solution = SOLVERS[name].solve(problem(), at(LONG + off))
    assert solution.cost < 1e-9
    if name != "ipopt-lbfgs":  # whose first steps are long
        assert max(iterate.step_norm for iterate in solution.trace) < 1.0  # to wrap is no step
    pose = solution.values["pose"]
    assert (np.linalg.norm(pose, axis=1) <= np.pi * 1.001).all()
    np.testing.assert_allclose(
        BODY.vertices(pose=pose, trans=solution.values["trans"]),
        BODY.vertices(pose=LONG),
        atol=1e-5,
    )


def test_a_prior_that_would_rise_keeps_its_pose() -> None:
    """A prior around the long form makes the short one dearer: it stays long."""
    prior = residuals.gaussian(SYMBOLS[0], mean=LONG, covariance=1e-4)
    solution = LevenbergMarquardt().solve(problem(prior), at(LONG + 0.01))
    np.testing.assert_allclose(solution.values["pose"], LONG, atol=1e-3)
    costs = np.array([i.cost for i in solution.trace])
    assert (np.diff(costs) < 0).all()


def test_a_start_near_a_full_turn_is_not_a_trap() -> None:
    """At 2 pi the exponential map has rank 1; one step later it is a small rotation."""
    pose = np.zeros((3, 3))
    pose[0] = [0.0, 2 * np.pi - 0.05, 0.0]
    start = BODY.start() | {"pose": pose, "observed": BODY.vertices(pose=np.full((3, 3), 0.3))}
    solution = LevenbergMarquardt().solve(problem(), start)
    assert solution.cost < 1e-9
    assert solution.iterations < 30


def test_a_constraint_on_the_pose_itself_keeps_it_long() -> None:
    """The turned pose is the same body, but not what was asked for."""
    long = Constraint("long", SYMBOLS[0][0, 1], lower=3.6)
    case = Problem((DATA,), ("pose", "trans"), constraints=(long,))
    solution = SOLVERS["ipopt"].solve(case, at(LONG + 0.01))
    assert solution.violation <= 1
    assert solution.values["pose"][1, 0] >= 3.6 - 1e-6
    assert np.linalg.norm(solution.values["pose"][2]) <= np.pi * 1.001
