"""Limbs that a fit has folded the wrong way."""

from dataclasses import replace

import numpy as np
import pytest

from tests.registration.test_free_vertices import body, sampled
from workbench.blocks import Values
from workbench.fitting.body_priors import pose_gaussian
from workbench.registration import FitStage, FreeVertices, fit_model
from workbench.registration.free_vertices import BODY, MODEL_STAGES, Settled
from workbench.registration.limbs import limbs, other_limbs, with_limb
from workbench.solvers import Solution

MODEL = MODEL_STAGES[:1]


def test_limbs_are_arms_and_legs() -> None:
    names = body().joint_names
    firsts = {names[limb[0]] for limb in limbs(body().parents)}
    assert firsts == {
        f"{side}_{joint}"
        for side in ("left", "right")
        for joint in ("hip", "knee", "collar", "shoulder", "elbow")
    }
    forearm = next(limb for limb in limbs(body().parents) if names[limb[0]] == "left_elbow")
    assert [names[joint] for joint in forearm] == ["left_elbow", "left_wrist", "left_hand"]


def test_joints_beside_a_limb_keep_rotations() -> None:
    limb = limbs(body().parents)[0]
    pose = np.random.default_rng(0).standard_normal((24, 3))
    mean = np.reshape(pose_gaussian(body())[0], (-1, 3))
    moved = with_limb(pose, limb, mean)
    others = np.delete(np.arange(24), limb)
    np.testing.assert_array_equal(moved[others], pose[others])
    np.testing.assert_array_equal(moved[list(limb)], mean[np.array(limb) - 1])


@pytest.mark.thorough
def test_fit_tries_other_poses_of_limbs() -> None:
    """What it finds takes the place of the hypothesis that it comes from, and tells its start."""
    truth, names = body().start(), body().joint_names
    pose, folded = truth["pose"].copy(), truth["pose"].copy()
    pose[names.index("left_elbow")] = [0, -1.2, 0]
    folded[names.index("left_elbow")] = [0, 0.5, -2]
    scan = sampled(body().vertices(**truth | {"pose": pose}), n=300)
    start = truth | {"pose": folded}
    stage = FitStage(300, 0.01, 0.03, 1, 20, 0.002)
    fits = [
        fit_model(body(), scan, starts=lambda body, scan: (start,), stages=(one,))
        for one in (stage, replace(stage, limbs=1))
    ]
    assert fits[1].cost < 0.95 * fits[0].cost
    assert fits[1].iterations > 2 * fits[0].iterations
    for fit in fits:
        assert [one.starts for one in fit.hypotheses] == [(0,)]
        here = fit.problem.linearize(fit.values)
        assert here.cost == pytest.approx(fit.cost)  # of the stage's own problem


@pytest.mark.thorough
@pytest.mark.parametrize(("limbs_too", "right"), [(False, False), (True, True)])
def test_wrongly_folded_forearm_is_unfolded(limbs_too: bool, right: bool) -> None:
    truth, names = body().start(), body().joint_names
    pose, folded = truth["pose"].copy(), truth["pose"].copy()
    pose[names.index("left_elbow")] = [0, -1.2, 0]
    folded[names.index("left_elbow")] = [0, 0.5, -2]
    there = truth | {"pose": pose}
    scan = sampled(body().vertices(**there), n=300)
    stages = (replace(MODEL[0], limbs=limbs_too, settled=0.01),)
    found = FreeVertices(body(), scan).register(truth | {"pose": folded}, stages)
    hand = names.index("left_hand")
    off = np.linalg.norm(
        (body().joints(*(found.values[name] for name in BODY)) - body().joints(**there))[hand]
    )
    assert (off < 0.03) == right


@pytest.mark.thorough
def test_right_fit_keeps_its_limbs() -> None:
    there = sampled(body().vertices(), n=200)
    noise = 0.005 * np.random.default_rng(1).standard_normal(there.points.shape)
    fit = FreeVertices(body(), replace(there, points=there.points + noise))
    problem = fit.problem(MODEL[0])

    def near(values: Values) -> Solution:
        return MODEL[0].solver.solve(problem, values, callback=Settled(0.001))

    assert other_limbs(body(), near, body().start()) is None
