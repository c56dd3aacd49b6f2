"""A trained body made alike on both sides: what is even already stays, what is local is found."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from builder.symmetrize import even_body, pose_parts, regressor_from
from workbench.errors import BadBody
from workbench.geometry.mirror import Mirror, opposites
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.pose_training import PoseModel
from workbench.training.registrations import InMemory, RegistrationSubset
from workbench.training.skinning_pass import SkinningPass

BODY = wb.load_body("small")
START = Start.of(BODY)
S, EACH = 12, 10


@pytest.fixture(scope="module")
def model() -> PoseModel:
    """Exact registrations of twelve people, and blend shapes that are wrong."""
    rng = np.random.default_rng(0)
    people = np.stack([BODY.template + BODY.shapedirs @ b for b in rng.normal(size=(S, 10))])
    joints = np.stack([BODY.J_regressor @ T for T in people])
    poses = 0.3 * rng.normal(size=(S * EACH, 24, 3))
    subject = np.repeat(np.arange(S), EACH)
    exact = Estimate(people, joints, BODY.posedirs, BODY.weights, poses, BODY.parents)
    data = InMemory(SkinningPass.of(exact, slice(0, S * EACH), subject).points, subject)
    assert BODY.mirror is not None
    mirror = Mirror(BODY.mirror, opposites(BODY.joint_names))
    objective = Objective(data, BODY.J_regressor, BODY.weights, mirror, Sigmas(), BODY.template)
    wrong = replace(exact, posedirs=BODY.posedirs + 1e-3 * rng.normal(size=BODY.posedirs.shape))
    return PoseModel(wrong, objective, ())


def test_blend_shapes_of_few_joints_are_found_again(model: PoseModel) -> None:
    """About where the data say; the translation was taken from the wrong ones."""
    parts = pose_parts(model, START)
    before, after = (model.objective.rms(e) for e in (model.estimate, parts.estimate))
    assert before > 0.003
    assert after < before / 10
    assert np.array_equal(parts.mirror.posedirs(parts.estimate.posedirs), parts.estimate.posedirs)
    assert parts.estimate.weights == pytest.approx(BODY.weights, abs=1e-3)


@pytest.mark.parametrize("people", [1, 3])
def test_few_people_are_enough_to_choose_a_ridge(model: PoseModel, people: int) -> None:
    rows, found = np.arange(people * EACH), model.estimate
    few = PoseModel(
        replace(
            found,
            templates=found.templates[:people],
            joints=found.joints[:people],
            poses=found.poses[rows],
        ),
        replace(
            model.objective, registrations=RegistrationSubset(model.objective.registrations, rows)
        ),
        (),
    )
    parts = pose_parts(few, START)
    before, after = (few.objective.rms(e) for e in (few.estimate, parts.estimate))
    assert after < before / 3


def test_joints_and_shapes_come_from_the_people_that_are_given(model: PoseModel) -> None:
    parts = pose_parts(model, START)
    regressor, errors = regressor_from(parts, np.arange(S))
    assert errors.max() < 0.002
    assert np.diff(regressor.indptr).max() <= 40
    body, explained = even_body(parts, parts.estimate.templates, regressor)
    assert explained.sum() == pytest.approx(1, abs=1e-3)  # ten directions made them
    assert body.template[BODY.mirror] * [-1, 1, 1] == pytest.approx(body.template, abs=1e-12)


def test_a_mesh_without_sides_is_refused(model: PoseModel) -> None:
    with pytest.raises(BadBody, match="a mesh with sides"):
        pose_parts(replace(model, objective=replace(model.objective, mirror=None)), START)
