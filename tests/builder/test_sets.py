"""Training sets that are written are what training reads; trained bodies are made symmetric."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

from builder import sets
from builder.bodies import already_made, even_body, pose_parts, regressor_from
from builder.ground_truth import FILE, read_ground_truth
from builder.sets import SetRecipe, Subjects, _stack, _table
from workbench import load_body
from workbench.errors import BadFile
from workbench.geometry.mirror import Mirror, opposites
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.first_guess import Start
from workbench.training.folder import open_folder
from workbench.training.objective import Objective
from workbench.training.pose_training import PoseModel
from workbench.training.registrations import InMemory

pytestmark = pytest.mark.thorough

BODY = load_body("small")
START = Start.of(BODY)
S, EACH = 12, 10


def subjects() -> Subjects:
    """Four people of the embedded shape space on the fine rig, the limbs' halves undivided."""
    people = BODY.vertices(betas=np.random.default_rng(0).standard_normal((4, 10)))
    joints = np.stack([BODY.J_regressor @ person for person in people])
    fine = csr_array(np.hstack([BODY.weights, np.zeros((369, 8))]))
    regressor = BODY.J_regressor.toarray()
    female = np.array([True, False, True, False])
    return Subjects(people, joints, female, BODY.weights, fine, regressor)


def test_pose_zero_is_rest_and_root_turns_all() -> None:
    everyone, away = subjects(), np.array([0.1, 0.2, 0.3])
    posed = everyone.posed(1, np.zeros((24, 3)), away)
    np.testing.assert_allclose(posed, everyone.rest[1] + away, atol=1e-12)
    quarter = np.zeros((24, 3))
    quarter[0, 1] = np.pi / 2
    turned = everyone.posed(1, quarter, np.zeros(3))
    pelvis = everyone.joints[1, 0]
    expected = (everyone.rest[1] - pelvis)[:, [2, 1, 0]] * [1, 1, -1] + pelvis
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_written_sets_are_registrations(tmp_path: Path) -> None:
    everyone, rng = subjects(), np.random.default_rng(1)
    poses = 0.1 * rng.standard_normal((2, 3, 24, 3))
    truth = _stack(everyone, 2, poses, rng, tmp_path / "poses.npy")
    assert truth.subject.tolist() == [0, 0, 0, 1, 1, 1]
    _table(tmp_path, [("poses", [2, 2, 2, 3, 3, 3])], everyone)
    start = Start.of(BODY)
    found = open_folder(tmp_path, 369, start.faces)
    assert found.subjects == ("person 2", "person 3")
    assert [row.gender for row in found.rows] == ["female"] * 3 + ["male"] * 3
    assert found.read(slice(0, 6)).vertices.shape == (6, 369, 3)


def test_missing_ground_truth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="does not exist"):
        read_ground_truth(tmp_path)
    np.savez(tmp_path / FILE, rest=np.zeros(3))
    with pytest.raises(BadFile, match="joints"):
        read_ground_truth(tmp_path)


def test_sets_of_another_recipe_are_refused(tmp_path: Path) -> None:
    recipe = SetRecipe()
    assert not already_made(tmp_path, recipe, None)
    for name in ("train", "held_out"):
        (tmp_path / name).mkdir()
        (tmp_path / name / sets.CARD).write_text(sets.recipe_text(recipe, None))
    assert already_made(tmp_path, recipe, None)
    card = tmp_path / "train" / sets.CARD
    card.write_text(card.read_text().replace('held_out":', 'strangers":'))  # of older versions
    assert already_made(tmp_path, recipe, None)
    with pytest.raises(BadFile, match="were made otherwise; remove"):
        already_made(tmp_path, SetRecipe(seed=7), None)
    with pytest.raises(BadFile, match="were made otherwise"):
        already_made(tmp_path, recipe, np.zeros((5, 24, 3)))


# Both sides alike.


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


def test_local_blend_shapes_are_found_again(model: PoseModel) -> None:
    """About where the data say; the translation was taken from the wrong ones."""
    parts = pose_parts(model, START)
    before, after = (model.objective.rms(e) for e in (model.estimate, parts.estimate))
    assert before > 0.003
    assert after < before / 10
    assert np.array_equal(parts.mirror.posedirs(parts.estimate.posedirs), parts.estimate.posedirs)
    assert parts.estimate.weights == pytest.approx(BODY.weights, abs=1e-3)


def test_joints_and_shapes_are_symmetric(model: PoseModel) -> None:
    parts = pose_parts(model, START)
    regressor, errors = regressor_from(parts, np.arange(S))
    assert errors.max() < 0.002
    assert np.diff(regressor.indptr).max() <= 40
    body, explained = even_body(parts, parts.estimate.templates, regressor)
    assert explained.sum() == pytest.approx(1, abs=1e-3)  # ten directions made them
    assert body.template[BODY.mirror] * [-1, 1, 1] == pytest.approx(body.template, abs=1e-12)
