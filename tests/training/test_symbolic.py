"""Training as one `Problem` of symbols: the same numbers as by blocks, and what it leaves open."""

from dataclasses import replace
from functools import cache
from math import inf

import numpy as np
import pytest
from scipy.sparse import csr_array

from workbench import Diagnosis, Values, diagnose
from workbench.arrays import Array
from workbench.errors import BadArgument, UnknownName
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
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
        found = SYMBOLIC.problem([term]).linearize(VALUES).cost
        assert found > 1
        assert found == pytest.approx(OBJECTIVE.costs(ESTIMATE)[term], rel=1e-12), term


@pytest.mark.thorough
def test_gradient_of_the_data_is_that_of_the_blocks() -> None:
    """The translation is at its optimum, so that it does not matter whether it follows."""
    names = ("templates", "posedirs", "joints", "weights")
    expected = ESTIMATE.zero_change(names)
    for passed, pull, _ in OBJECTIVE.residuals(ESTIMATE):
        passed.adjoint(-pull / OBJECTIVE.sigmas.data**2, expected)
    problem = SYMBOLIC.problem(["E_D"])
    found = problem.free.unpack(problem.linearize(VALUES).gradient)
    largest = max(abs(array).max() for array in expected.values())
    for array in ("posedirs", "weights"):
        np.testing.assert_allclose(found[array], expected[array], atol=1e-12 * largest)
    for s in range(3):
        for name, array in (("template", "templates"), ("joints", "joints")):
            there = found[f"subject {s}/{name}"]
            np.testing.assert_allclose(there, expected[array][s], atol=1e-12 * largest)
    for j in range(12):
        assert abs(found[f"scan {j}/trans"]).max() < 1e-9 * largest


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


SUBJECTS, POSES = 4, 6


@cache
def limb(
    subjects: int = SUBJECTS, poses: int = POSES, rings: int = 15
) -> tuple[SymbolicTraining, Values]:
    """Four vertices on each ring, on a root and one joint, in exact registrations of subjects."""
    tube = jointed_tube(rings, 4)
    half = np.where(tube.template[:, 0] > 0, 1, 0)
    start = Start(tube.template, tube.faces, (-1, 0), ("root", "tip"), half)
    body = random_smpl(start, 2, seed=3)
    data, truth = draw_registrations(body, subjects, poses, seed=4)
    people = body.vertices(betas=truth.betas)
    joints = np.stack([body.J_regressor @ person for person in people])
    estimate = Estimate(people, joints, body.posedirs, body.weights, truth.poses, body.parents)
    weights = start.weights()
    middle = csr_array(np.full((2, body.n_vertices), 1 / body.n_vertices))  # E_J reads all vertices
    objective = Objective(data, middle, weights, None, Sigmas(), start.template)
    symbolic = SymbolicTraining.of(body, objective)
    return symbolic, symbolic.values(estimate)


@cache
def diagnosed(*terms: str) -> Diagnosis:
    symbolic, values = limb()
    found = diagnose(symbolic.problem(terms), values)
    assert isinstance(found, Diagnosis)
    return found


@pytest.mark.thorough
def test_gauges_of_the_data_alone_are_named() -> None:
    d = diagnosed("E_D")
    assert d.shape == (4320, 2700)
    names = [direction.name for direction in d.null_directions]
    expected = [
        f"a translation along {axis} of {what}, undone by scan {POSES * s}/trans to "
        f"scan {POSES * s + POSES - 1}/trans"
        for s in range(SUBJECTS)
        for what in (f"subject {s}/template and subject {s}/joints", f"subject {s}/joints[root]")
        for axis in "xyz"
    ]
    expected += [  # everything at rest, against every root
        f"a rotation about {axis} of subject 0/template, undone by posedirs, subject 0/joints, "
        "subject 1 to subject 3 and 1 more"
        for axis in "xyz"
    ]
    # and blend shapes push the whole surface along the joint's axis, which has no name of its own
    assert set(names) >= set(expected)
    assert d.rank == 2700 - len(expected) - 4 == 2700 - len(names)
    largest = float(d.here.column_norms.max())
    assert max(direction.change for direction in d.null_directions) < 1e-12 * largest


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("terms", "left"),
    [
        (("E_D", "E_P"), 12 + 12),  # shifts and roots: a turn would change the blend shapes
        (TERMS, 0),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, tuple) else str(given),
)
def test_priors_fix_gauges(terms: tuple[str, ...], left: int) -> None:
    d = diagnosed(*terms)
    assert len(d.null_directions) == d.shape[1] - d.rank == left
    assert all(direction.kind == "translation" for direction in d.null_directions)
