"""Shape directions, joints that go with them, and counting."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import smpl_like_body
from workbench.course.shapes.counting import SLIDE, SMPL_SIZE, counts, dense_counts, total
from workbench.course.shapes.shape_directions import (
    along,
    joint_moves,
    reconstruction_errors,
    variances,
    with_joints_of_the_mean,
)

BODY = wb.load_body("small")


def test_the_counts_of_the_released_model_and_of_the_slide() -> None:
    released = {count.name: count.numbers for count in dense_counts(*SMPL_SIZE)}
    assert released["posedirs"] == 4_278_690 == 3 * 9 * 23 * 6890
    assert released["template"] + released["shapedirs"] == 227_370
    assert sum(released.values()) == 4_836_780
    assert total(SLIDE) == 6_014_970
    slide = {row.name: row for row in SLIDE}
    for name in ("template", "shapedirs", "posedirs"):
        assert slide[name].numbers == released[name]
    assert slide["weights"].numbers == 3 * 4 * 6890 != released["weights"] == 165_360
    assert slide["J_regressor"].numbers == 3 * 6890 * 23 * 3 != 23 * 6890 == 158_470
    for name in ("posedirs", "weights", "J_regressor"):
        assert slide[name].remark


def test_counts_are_those_of_the_arrays() -> None:
    found = {count.name: count for count in counts(BODY)}
    assert [count.numbers for count in counts(BODY)] == [
        count.numbers for count in dense_counts(369, 24, 10)
    ]
    assert found["J_regressor"].nonzero == BODY.J_regressor.nnz
    assert found["weights"].nonzero == np.count_nonzero(BODY.weights)
    assert found["posedirs"].shape == (369, 3, 207)


def test_directions_are_orthogonal_and_longest_first() -> None:
    """Principal components; the body's own, to the rounding of its file."""
    S = BODY.shapedirs.reshape(-1, 10)
    unit = S / np.linalg.norm(S, axis=0)
    gram = np.abs(unit.T @ unit - np.eye(10))
    assert gram.max() < 0.03
    assert (np.diff(variances(BODY)) < 0).all()


def test_betas_along_a_direction_move_the_surface_on_a_line() -> None:
    for k in (0, 9):
        ends = [BODY.vertices(betas=along(BODY, k, amount)) for amount in (3.0, -3.0)]
        np.testing.assert_allclose(np.mean(ends, axis=0), BODY.template, atol=1e-15)
        np.testing.assert_allclose(ends[0] - ends[1], 6 * BODY.shapedirs[:, :, k], atol=1e-14)


def test_nothing_is_left_of_people_of_the_space_wherever_they_stand() -> None:
    rng = np.random.default_rng(0)
    people = BODY.vertices(betas=rng.normal(size=(5, 10))) + rng.normal(size=(5, 1, 3))
    left = reconstruction_errors(BODY, people)
    assert left.shape == (11, 5)
    assert (np.diff(left, axis=0) <= 1e-15).all()
    assert left[-1].max() < 1e-12
    only_two = BODY.vertices(betas=[[1.0, -2.0]])
    assert (
        reconstruction_errors(BODY, only_two)[2].max()
        < 1e-12
        < reconstruction_errors(BODY, only_two)[1].min()
    )


def test_joints_go_with_the_shape_and_can_be_kept_from_it() -> None:
    body, betas = smpl_like_body(), [1.0, -1.0, 0.5, 2.0]
    moved = np.linalg.norm(body.joints(betas=betas) - body.joints(), axis=1)
    np.testing.assert_allclose(joint_moves(body, betas), moved, atol=1e-15)
    kept = with_joints_of_the_mean(body, betas)
    np.testing.assert_allclose(kept.vertices(), body.vertices(betas=betas), atol=1e-14)
    np.testing.assert_allclose(kept.joints(), body.joints(), atol=1e-12)
    pose = np.random.default_rng(0).normal(scale=0.5, size=(24, 3))
    assert np.abs(kept.vertices(pose) - body.vertices(pose, betas)).max() > 1e-3
    same = with_joints_of_the_mean(body, np.zeros(4))
    np.testing.assert_allclose(same.vertices(pose), body.vertices(pose), atol=1e-12)


def test_a_taller_person_on_the_means_joints_bends_in_the_wrong_places() -> None:
    tall = along(BODY, 0, 3.0)
    assert 0.05 < joint_moves(BODY, tall).max() < 0.4  # m
    pose = np.zeros((24, 3))
    pose[4, 0] = np.pi / 2
    wrong = with_joints_of_the_mean(BODY, tall).vertices(pose) - BODY.vertices(pose, tall)
    assert np.linalg.norm(wrong, axis=1).max() > 0.02
    assert np.linalg.norm(wrong[BODY.template[:, 1] > 0.2], axis=1).max() < 1e-12


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_variances_are_squares_of_the_unit(scale: float) -> None:
    wider = replace(BODY, shapedirs=scale * BODY.shapedirs)
    np.testing.assert_allclose(variances(wider), scale**2 * variances(BODY))
