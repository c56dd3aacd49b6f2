"""The made training sets: what is written is what training reads."""

from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from workbench import load_body
from workbench.training.first_guess import Start
from workbench.training.folder import open_folder
from workbench.training.sets import Cast, _stack, _table

BODY = load_body("small")


def cast() -> Cast:
    """Four people of the embedded shape space on the fine rig, the limbs' halves undivided."""
    people = BODY.vertices(betas=np.random.default_rng(0).standard_normal((4, 10)))
    joints = np.stack([BODY.J_regressor @ person for person in people])
    fine = csr_array(np.hstack([BODY.weights, np.zeros((369, 8))]))
    return Cast(people, joints, np.array([True, False, True, False]), fine)


def test_nobody_moves_without_a_pose() -> None:
    everyone, away = cast(), np.array([0.1, 0.2, 0.3])
    posed = everyone.posed(1, np.zeros((24, 3)), 0.0, away)
    np.testing.assert_allclose(posed, everyone.rest[1] + away, atol=1e-12)
    turned = everyone.posed(1, np.zeros((24, 3)), np.pi / 2, np.zeros(3))
    pelvis = everyone.joints[1, 0]
    expected = (everyone.rest[1] - pelvis)[:, [2, 1, 0]] * [1, 1, -1] + pelvis
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_what_is_written_is_a_folder_of_registrations(tmp_path: Path) -> None:
    everyone, rng = cast(), np.random.default_rng(1)
    poses = 0.1 * rng.standard_normal((2, 3, 24, 3))
    rows = _stack(everyone, 2, poses, rng, tmp_path / "poses.npy")
    assert rows == [2, 2, 2, 3, 3, 3]
    _table(tmp_path, [("poses", rows)], everyone)
    start = Start.of(BODY)
    found = open_folder(tmp_path, 369, start.faces)
    assert found.subjects == ("person 2", "person 3")
    assert [row.gender for row in found.rows] == ["female"] * 3 + ["male"] * 3
    assert found.read(slice(0, 6)).vertices.shape == (6, 369, 3)
