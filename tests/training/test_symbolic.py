"""Training as one `Problem` of symbols: the same numbers as by blocks, and what it leaves open."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from workbench.arrays import Array
from workbench.errors import BadArgument, UnknownName
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.objective import Objective
from workbench.training.symbolic import TERMS, SymbolicTraining

START = jointed_tube(7, 5)
BODY = random_smpl(START, 2, seed=3)
EXACT, TRUTH = draw_registrations(BODY, 3, 4, seed=4)
DATA = CorruptedRegistrations(
    EXACT, seed=2, noise=0.002, missing=0.1
)  # some vertices have confidence 0
OBJECTIVE = Objective(
    DATA, START.rings(), START.weights(), START.mirror(), Sigmas(), START.template
)
SYMBOLIC = SymbolicTraining.of(BODY, OBJECTIVE)
RNG = np.random.default_rng(1)


def near(array: Array, size: float) -> Array:
    return np.asarray(array + size * RNG.standard_normal(array.shape))


PEOPLE = BODY.vertices(betas=TRUTH.betas)
ESTIMATE = Estimate(
    near(PEOPLE, 0.01),
    near(np.stack([BODY.J_regressor @ person for person in PEOPLE]), 0.01),
    near(BODY.posedirs, 0.002),
    BODY.weights,
    near(TRUTH.poses, 0.1),
    BODY.parents,
)
VALUES = SYMBOLIC.values(ESTIMATE)


@pytest.mark.thorough
def test_terms_are_those_of_the_blocks() -> None:
    for term in TERMS:
        cost = SYMBOLIC.problem([term]).linearize(VALUES).cost
        assert cost > 1
        assert cost == pytest.approx(OBJECTIVE.costs(ESTIMATE)[term], rel=1e-12), term


@pytest.mark.thorough
def test_gradient_of_the_data_is_that_of_the_blocks() -> None:
    """The translation is at its optimum, so that it does not matter whether it follows."""
    names = ("templates", "posedirs", "joints", "weights")
    expected = ESTIMATE.zero_change(names)
    for passed, pull, _ in OBJECTIVE.residuals(ESTIMATE):
        passed.adjoint(-pull / OBJECTIVE.sigmas.data**2, expected)
    problem = SYMBOLIC.problem(["E_D"])
    gradient = problem.free.unpack(problem.linearize(VALUES).gradient)
    largest = max(abs(array).max() for array in expected.values())
    for array in ("posedirs", "weights"):
        np.testing.assert_allclose(gradient[array], expected[array], atol=1e-12 * largest)
    for s in range(3):
        for name, array in (("template", "templates"), ("joints", "joints")):
            of_subject = gradient[f"subject {s}/{name}"]
            np.testing.assert_allclose(of_subject, expected[array][s], atol=1e-12 * largest)
    for j in range(12):
        assert abs(gradient[f"scan {j}/trans"]).max() < 1e-9 * largest


def test_joints_are_compared_with_the_learned_regressor() -> None:
    learned = replace(ESTIMATE, regressor=BODY.J_regressor)
    symbolic = SymbolicTraining.of(BODY, OBJECTIVE, learned.regressor)
    cost = symbolic.problem(["E_J"]).linearize(symbolic.values(learned)).cost
    assert cost == pytest.approx(OBJECTIVE.costs(learned)["E_J"], rel=1e-12)
    assert abs(cost - OBJECTIVE.costs(ESTIMATE)["E_J"]) > 1
    with pytest.raises(BadArgument, match="has learned a joint regressor"):
        SYMBOLIC.values(learned)


def test_confidences_that_depend_on_the_direction_are_refused() -> None:
    matrices = replace(EXACT, confidence=np.tile(np.eye(3), (*EXACT.vertices.shape[:2], 1, 1)))
    with pytest.raises(BadArgument, match="one number for each vertex"):
        SymbolicTraining.of(BODY, replace(OBJECTIVE, registrations=matrices))


def test_terms_switched_off_have_no_residual() -> None:
    off = Sigmas(**(dict.fromkeys(("symmetry", "joint_symmetry", "rings", "weights"), inf)))
    quiet = replace(OBJECTIVE, sigmas=off, template=None)
    symbolic = SymbolicTraining.of(BODY, quiet)
    counts = {term: len(symbolic.residuals(term)) for term in TERMS}
    assert counts == {"E_D": 12, "E_Y": 0, "E_J": 0, "E_P": 1, "E_W": 0, "E_T": 0}


def test_unknown_terms_are_refused() -> None:
    with pytest.raises(UnknownName, match="E_X"):
        SYMBOLIC.residuals("E_X")
