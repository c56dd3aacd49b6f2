"""The least errors that skinning can have, of registrations whose ground truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from builder.ground_truth import (
    GroundTruth,
    best_linear,
    errors_of_ideal_skinning,
    ideal_skinning_errors,
)
from builder.training import training_and_held_out
from workbench.errors import BadArgument
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.registrations import Registrations

START = jointed_tube(7, 5)
EVEN = replace(random_smpl(START, 2, seed=3), mirror=START.mirror().vertices)  # type: ignore[union-attr]


def made(seed: int, subjects: int = 3, poses: int = 30) -> tuple[GroundTruth, Registrations]:
    data, drawn = draw_registrations(EVEN, subjects, poses, seed, turn=1.0)
    rest = EVEN.vertices(betas=drawn.betas)
    joints = np.stack([EVEN.J_regressor @ person for person in rest])
    return GroundTruth(rest, joints, data.subject, drawn.poses, drawn.trans, EVEN.weights), data


def test_ideal_skinning_is_exact_with_true_blend_shapes() -> None:
    truth, data = made(4)
    assert errors_of_ideal_skinning(truth, data, START, EVEN.posedirs).max() < 1e-12
    alone = errors_of_ideal_skinning(truth, data, START)
    assert alone.mean() > 1e-3
    found = ideal_skinning_errors(truth, data, START, EVEN.posedirs)
    assert found["ideal_linear_mean_mm"] == 0
    assert found["ideal_skinning_mean_mm"] == pytest.approx(1e3 * alone.mean(), abs=1e-4)


@pytest.mark.thorough
def test_best_linear_predictor_is_the_generator() -> None:
    uneven = replace(START, joint_names=tuple(f"joint_{k}" for k in range(6)))  # nothing mirrored
    truth, data = made(4, poses=80)
    found = best_linear(truth, data, uneven)
    left = errors_of_ideal_skinning(truth, data, START, found).mean()
    assert left < 0.1 * errors_of_ideal_skinning(truth, data, START).mean()


def test_last_fifth_of_subjects_is_held_out() -> None:
    kept, back = training_and_held_out(np.array([0, 1, 2, 0, 1, 2]))
    assert (kept.tolist(), back.tolist()) == ([0, 1, 3, 4], [2, 5])
    assert training_and_held_out(np.arange(10))[1].tolist() == [8, 9]


def test_registrations_of_one_subject_are_held_out() -> None:
    kept, back = training_and_held_out(np.full(11, 3))
    assert (kept.tolist(), back.tolist()) == ([*range(9)], [9, 10])
    with pytest.raises(BadArgument, match="cannot be held out of fewer than two"):
        training_and_held_out(np.zeros(1, int))
