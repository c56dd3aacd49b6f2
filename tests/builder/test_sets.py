"""The made training sets: what is written is what training reads."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

from builder import sets
from builder.bodies import already_made
from builder.sets import SetRecipe, Subjects, _stack, _table
from workbench import load_body
from workbench.errors import BadFile
from workbench.synthetic.ground_truth import FILE, read_ground_truth
from workbench.training.first_guess import Start
from workbench.training.folder import open_folder

BODY = load_body("small")


def subjects() -> Subjects:
    """Four people of the embedded shape space on the fine rig, the limbs' halves undivided."""
    people = BODY.vertices(betas=np.random.default_rng(0).standard_normal((4, 10)))
    joints = np.stack([BODY.J_regressor @ person for person in people])
    fine = csr_array(np.hstack([BODY.weights, np.zeros((369, 8))]))
    regressor = BODY.J_regressor.toarray()
    female = np.array([True, False, True, False])
    return Subjects(people, joints, female, BODY.weights, fine, regressor)


def test_every_option_of_the_command_is_in_the_recipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[SetRecipe] = []
    monkeypatch.setattr(sets, "make_sets", lambda sources, recipe, *_: asked.append(recipe))
    monkeypatch.setattr(sets, "gather_sources", lambda *_: None)
    monkeypatch.setattr(sets, "Wheel", lambda path: path)
    options = "--body full --vertices 6890 --people 5 --subjects 4 --poses 3"
    for held_out in ("--held-out 2", "--strangers 2"):  # the second is the former name
        line = f"sets WHEEL --out {tmp_path} {options} {held_out} --others 1 --seed 9"
        monkeypatch.setattr("sys.argv", line.split())
        sets.main()
    assert asked == 2 * [SetRecipe("full", 5, 4, 3, 2, 1, 6890, seed=9)]


def test_nobody_moves_without_a_pose() -> None:
    everyone, away = subjects(), np.array([0.1, 0.2, 0.3])
    posed = everyone.posed(1, np.zeros((24, 3)), away)
    np.testing.assert_allclose(posed, everyone.rest[1] + away, atol=1e-12)
    quarter = np.zeros((24, 3))
    quarter[0, 1] = np.pi / 2
    turned = everyone.posed(1, quarter, np.zeros(3))
    pelvis = everyone.joints[1, 0]
    expected = (everyone.rest[1] - pelvis)[:, [2, 1, 0]] * [1, 1, -1] + pelvis
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_what_is_written_is_a_folder_of_registrations(tmp_path: Path) -> None:
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


def test_what_was_made_is_kept_beside_it(tmp_path: Path) -> None:
    everyone, rng = subjects(), np.random.default_rng(1)
    poses = 0.1 * rng.standard_normal((2, 3, 24, 3))
    _stack(everyone, 2, poses, rng, tmp_path / "poses.npy").save(tmp_path)
    truth, meshes = read_ground_truth(tmp_path), np.load(tmp_path / "poses.npy")
    again = everyone.posed(3, truth.poses[4], truth.trans[4])
    np.testing.assert_allclose(again, meshes[4], atol=1e-6)
    np.testing.assert_array_equal(truth.rest, everyone.rest[2:])


def test_registrations_of_unknown_making_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="does not exist"):
        read_ground_truth(tmp_path)
    np.savez(tmp_path / FILE, rest=np.zeros(3))
    with pytest.raises(BadFile, match="joints"):
        read_ground_truth(tmp_path)


def test_every_other_pose_moves_every_joint() -> None:
    """Mocap hardly bends a wrist; the poses between are as they were drawn."""
    recipe = SetRecipe(subjects=30, poses=4)
    drawn = np.zeros((30, 4, 24, 3))
    drawn[..., 3, :] = 2.5, 0, 0  # already far
    stirred = sets._stirred(drawn, recipe)
    assert np.array_equal(stirred[:, 1::2], drawn[:, 1::2])
    spread = stirred[:, ::2, 4:].std(axis=(0, 1))
    np.testing.assert_allclose(spread, recipe.stirred, rtol=0.4)
    assert np.linalg.norm(stirred, axis=-1).max() <= sets.LARGEST_ANGLE + 1e-12
    assert np.array_equal(stirred, sets._stirred(drawn, recipe))


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
