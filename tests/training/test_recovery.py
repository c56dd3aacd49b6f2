"""Training finds the body that its registrations were made with.

What cannot be found, and is not asked for: the root joint (turning about another point is a
translation more), the frame that all rest shapes are drawn in (a rotation of all of them, with
posedirs turned along, changes no mesh), and a row of the joint regressor by itself (many rows give
the same joints on all bodies of a shape space; a held-out body of that space decides nothing).
"""

from dataclasses import dataclass, replace
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
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective

pytestmark = pytest.mark.thorough


TURN = 1.6  # rad, the largest
SIGMAS = Sigmas(
    data=0.001, symmetry=inf, joint_symmetry=inf, rings=0.02, posedirs=0.005, weights=0.3
)
FREE = replace(SIGMAS, rings=inf, posedirs=inf, weights=inf)  # of every term but E_D


@dataclass(frozen=True, eq=False)
class Near:
    """Steps of all names together on a small body, from the truth disturbed in every name."""

    objective: Objective
    start: Start
    estimate: Estimate

    def together(self, estimate: Estimate, **options: float) -> Estimate:
        """The block with these options."""
        given = replace(BlockOptions(), **options)
        return BLOCKS["together"](BlockInput(self.objective, self.start.faces, given), estimate)[0]


@pytest.fixture(scope="module")
def near() -> Near:
    """Off by 1 mm, 0.01 rad, weights by a fiftieth, blend shapes by half a mm."""
    start = jointed_tube(9, 6)
    body = random_smpl(start, 1, seed=0)
    data, truth = draw_registrations(body, 4, 20, seed=1, turn=TURN)
    exact, rng = at_the_truth(body, truth), np.random.default_rng(7)
    weights = np.where(body.weights > 0, body.weights + 0.02 * rng.random(body.weights.shape), 0)
    disturbed = replace(
        exact,
        templates=exact.templates + 0.001 * rng.standard_normal(exact.templates.shape),
        joints=exact.joints + 0.003 * rng.standard_normal(exact.joints.shape),
        posedirs=exact.posedirs + 0.0005 * rng.standard_normal(exact.posedirs.shape),
        weights=weights / weights.sum(axis=1, keepdims=True),
        poses=exact.poses + 0.01 * rng.standard_normal(exact.poses.shape),
    )
    return Near(Objective(data, start.rings(), start.weights(), None, FREE), start, disturbed)


def at_the_truth(body: SkinnedBody, truth: Truth) -> Estimate:
    """What made the registrations."""
    people = body.vertices(betas=truth.betas)
    joints = np.stack([body.J_regressor @ person for person in people])
    return Estimate(people, joints, body.posedirs, body.weights, truth.poses, body.parents)


def test_steps_in_all_names_converge_quadratically(near: Near) -> None:
    """Near the truth, off in every name, the residual falls faster and faster."""
    estimate, rms = near.estimate, [near.objective.rms(near.estimate)]
    for _ in range(4):
        estimate = near.together(estimate, together_tolerance=1e-4, together_steps=1, products=250)
        rms.append(near.objective.rms(estimate))
    assert rms[-1] < 1e-6
    falls = np.array(rms[1:]) / rms[:-1]
    assert falls[1] < 0.1
    np.testing.assert_allclose(estimate.weights.sum(axis=1), 1, atol=1e-12)


def template_error(start: Start, body: SkinnedBody, poses: int, noise: float = 0.001) -> float:
    """Rms of E_D's surplus over the noise: how far the fitted points are from the exact ones."""
    data, truth = draw_registrations(body, 4, poses, seed=3, turn=TURN)
    noisy = CorruptedRegistrations(data, seed=4, noise=noise)
    exact = Objective(data, start.rings(), start.weights(), None, FREE)
    fitted = Objective(noisy, start.rings(), start.weights(), None, FREE)
    at = at_the_truth(body, truth)
    given = BlockInput(fitted, start.faces, BlockOptions(products=400))
    found, _ = BLOCKS["surfaces"](given, at)
    return exact.rms(found)


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
