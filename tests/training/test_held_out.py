"""Held-out people: the body that made them explains them; a body that is wrong does not."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.errors import BadArgument
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.evaluation import (
    GroundTruth,
    best_linear,
    errors_of_ideal_skinning,
    evaluate_held_out,
    held_out_errors,
    ideal_skinning_errors,
    shape_share,
    shapes_explained,
)
from workbench.training.registrations import RegistrationSubset, training_and_held_out

START = jointed_tube(7, 5)
BODY = replace(random_smpl(START, 2, seed=3), mirror=START.mirror().vertices)  # type: ignore[union-attr]


def made(seed: int, subjects: int = 3, poses: int = 30) -> tuple[GroundTruth, RegistrationSubset]:
    data, drawn = draw_registrations(BODY, subjects, poses, seed, turn=1.0)
    rest = BODY.vertices(betas=drawn.betas)
    joints = np.stack([BODY.J_regressor @ person for person in rest])
    truth = GroundTruth(rest, joints, data.subject, drawn.poses, drawn.trans, BODY.weights)
    return truth, RegistrationSubset(data, np.arange(subjects * poses))


def test_ideal_skinning_is_exact_with_true_blend_shapes() -> None:
    truth, data = made(4)
    assert errors_of_ideal_skinning(truth, data, START, BODY.posedirs).largest < 1e-12
    alone = errors_of_ideal_skinning(truth, data, START)
    assert alone.mean > 1e-3
    found = ideal_skinning_errors(truth, data, START, BODY.posedirs)
    assert found["ideal_linear_mean_mm"] == 0
    assert found["ideal_skinning_mean_mm"] == pytest.approx(1e3 * alone.mean, abs=1e-4)


@pytest.mark.thorough
def test_best_linear_predictor_is_the_generator() -> None:
    uneven = replace(START, joint_names=tuple(f"joint_{k}" for k in range(6)))  # nothing mirrored
    truth, data = made(4, poses=80)
    found = best_linear(truth, data, uneven)
    left = errors_of_ideal_skinning(truth, data, START, found).mean
    assert left < 0.1 * errors_of_ideal_skinning(truth, data, START).mean


def test_every_second_registration_is_held_out() -> None:
    _, data = made(5, subjects=2, poses=4)
    told = evaluate_held_out(replace(BODY, mirror=None), data)
    assert told.errors.distances.shape == (4, 35)
    assert told.errors.mean < 0.02


def test_order_of_registrations_does_not_change_held_out_errors() -> None:
    _, data = made(5, subjects=3, poses=2)  # of people a a b b c c
    body = replace(BODY, mirror=None)
    in_order = evaluate_held_out(body, data)
    mixed = evaluate_held_out(body, RegistrationSubset(data, np.array([0, 2, 1, 3, 4, 5])))
    assert mixed.errors.mean == pytest.approx(in_order.errors.mean, rel=1e-6)
    assert mixed.errors.mean < 0.01  # m
    np.testing.assert_allclose(mixed.templates, in_order.templates, atol=1e-9)


def test_person_with_one_registration_is_refused() -> None:
    _, data = made(5, subjects=3, poses=2)
    with pytest.raises(BadArgument, match=r"there is only one of subject 1$"):
        evaluate_held_out(BODY, RegistrationSubset(data, np.array([0, 1, 2, 4, 5])))


@pytest.mark.thorough
def test_body_explains_those_it_made() -> None:
    _, data = made(5, subjects=2, poses=8)
    uneven = replace(BODY, mirror=None)
    told = evaluate_held_out(uneven, data)
    assert told.errors.distances.shape == (8, 35)
    wrong = evaluate_held_out(replace(uneven, posedirs=0 * BODY.posedirs), data).errors.mean
    assert told.errors.mean < 0.4 * wrong
    assert told.shape_explained > 0.7
    found = held_out_errors(uneven, data)
    assert found["mean_mm"] == pytest.approx(1e3 * told.errors.mean, abs=1e-4)
    assert found["mean_without_posedirs_mm"] == pytest.approx(1e3 * wrong, abs=1e-4)
    assert found["people_in_poses"] == 2


def test_people_in_one_pose_are_as_the_body_makes_them() -> None:
    data, _ = draw_registrations(BODY, 6, 1, seed=8, turn=0.1)
    found = shapes_explained(BODY, data)
    assert found["people_in_one_pose"] == 6
    assert found["their_shape_variance_explained"] > 0.95
    odd = replace(BODY, shapedirs=BODY.shapedirs[:, ::-1])
    assert shapes_explained(odd, data)["their_shape_variance_explained"] < 0.8


def test_shape_share_of_what_is_known() -> None:
    inside = BODY.vertices(betas=np.array([[1.0, 2.0], [0.5, -1.0]]))
    assert shape_share(BODY, inside) == pytest.approx(1)
    assert shape_share(BODY, inside + [1.0, 2.0, 3.0]) == pytest.approx(1)
    away = np.random.default_rng(0).standard_normal((40, 35, 3))
    assert shape_share(BODY, BODY.template + away) == pytest.approx(2 / 102, rel=0.5)
    assert shape_share(BODY, BODY.template[None]) == 1  # there is nothing to explain


def test_last_fifth_of_subjects_is_held_out() -> None:
    kept, back = training_and_held_out(np.array([0, 1, 2, 0, 1, 2]))
    assert (kept.tolist(), back.tolist()) == ([0, 1, 3, 4], [2, 5])
    assert training_and_held_out(np.arange(10))[1].tolist() == [8, 9]


def test_registrations_of_one_subject_are_held_out() -> None:
    kept, back = training_and_held_out(np.full(11, 3))
    assert (kept.tolist(), back.tolist()) == ([*range(9)], [9, 10])
    with pytest.raises(BadArgument, match="cannot be held out of fewer than two"):
        training_and_held_out(np.zeros(1, int))
