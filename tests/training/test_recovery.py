"""Training finds the body that its registrations were made with, as well as their noise allows."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from workbench import SkinnedBody
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    Truth,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.estimate import TERMS, Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective

pytestmark = pytest.mark.thorough


TURN = 1.6  # rad, the largest
FREE = replace(Sigmas(data=0.001), **dict.fromkeys(TERMS, inf))  # of every term but E_D


def at_the_truth(body: SkinnedBody, truth: Truth) -> Estimate:
    """What made the registrations."""
    people = body.vertices(betas=truth.betas)
    joints = np.stack([body.J_regressor @ person for person in people])
    return Estimate(people, joints, body.posedirs, body.weights, truth.poses, body.parents)


def template_error(start: Start, body: SkinnedBody, poses: int, noise: float = 0.001) -> float:
    """Rms of E_D's surplus over the noise: how far the fitted points are from the exact ones."""
    data, truth = draw_registrations(body, 4, poses, seed=3, turn=TURN)
    noisy = CorruptedRegistrations(data, seed=4, noise=noise)
    exact = Objective(data, start.rings(), start.weights(), None, FREE)
    fitted = Objective(noisy, start.rings(), start.weights(), None, FREE)
    at = at_the_truth(body, truth)
    context = BlockInput(fitted, start.faces, BlockOptions(products=400))
    estimate, _ = BLOCKS["surfaces"](context, at)
    return exact.rms(estimate)


def test_error_falls_with_registrations_as_predicted() -> None:
    """Linear least squares: rms error / noise = sqrt(unknowns / equations).

    The unknowns stay the same, so with four times the registrations it is half as large.
    """
    start = jointed_tube(7, 5)
    body = random_smpl(start, 2, seed=0)
    S, K, N = 4, 6, 35
    errors = []
    for poses in (20, 80):
        error = template_error(start, body, poses)
        errors.append(error)
        unknowns = S * 3 * (N + K) - 3 * S - 3 * S + N * 3 * 9 * (K - 1)
        equations = 3 * (N - 1) * S * poses
        predicted = 0.001 * np.sqrt(unknowns / equations * (N - 1) / N)
        assert error == pytest.approx(predicted, rel=0.1)
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
