"""Shape directions, and joints that go with them."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import smpl_like_body
from workbench.lectures.material.shape_directions import along, joint_moves, with_joints_of_the_mean

EXAMPLE = import_module("examples.24_shape_directions")
reconstruction_errors, variances = EXAMPLE.reconstruction_errors, EXAMPLE.variances
BODY = wb.load_body("small")


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
