"""The studies of a checkout: the laws of what they measure with, and a small run of each."""

import csv
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import workbench as wb
from builder.triangle_learning import Lsqr
from examples.studies import (
    blend_shapes,
    coregistration,
    icp_basins,
    spin_loop,
    triangles,
)
from examples.studies.triangle_alternation import TriangleOptions
from tests.bodies_made_up import random_body
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.lectures.material.teacher import body_on_teachers_rig, teacher_of
from workbench.training.blocks import Plan

pytestmark = pytest.mark.thorough

SMALL = wb.load_body("small")
LBS = body_on_teachers_rig(SMALL)


def silent(line: str) -> None:
    pass


# Blend shapes.


def many_people(seed: int) -> np.ndarray:
    """The small body's shapes, and bumps that no shape direction has: full rank."""
    rng = np.random.default_rng(seed)
    people = SMALL.vertices(betas=rng.normal(size=(24, 10)))
    middles = SMALL.template[rng.integers(SMALL.n_vertices, size=(24, 5))]
    apart = np.linalg.norm(SMALL.template[None, :, None] - middles[:, None], axis=-1)
    bumps = np.einsum("pnc,pca->pna", np.exp(-((apart / 0.1) ** 2)), rng.normal(size=(24, 5, 3)))
    return np.asarray(people + 0.01 * bumps)


def test_body_on_teachers_rig_moves_as_the_teacher() -> None:
    """So that blending of bones is all that it can get wrong: a turn of the root is no matter."""
    assert not LBS.posedirs.any()
    assert (LBS.weights > 0).sum(axis=1).max() <= 4
    assert_allclose(LBS.weights.sum(axis=1), 1, atol=1e-12)
    teacher, poses = teacher_of(SMALL), np.zeros((2, 24, 3))
    poses[0, 0], poses[1, 4] = (0.3, -0.7, 1.1), (1.0, 0, 0)
    away = [LBS.vertices(pose) - teacher.vertices(pose) for pose in poses]
    rooted, kneeling = np.linalg.norm(away, axis=2)
    assert rooted.max() < 1e-12
    far = LBS.weights[:, [0, 4, 7, 10]].sum(axis=1) == 0
    assert kneeling[far].max() < 1e-12
    assert 0.001 < kneeling.max() < 0.03
    with pytest.raises(BadFile, match=r"no teacher for body 'made-up'; .* default and small"):
        teacher_of(random_body())


def test_group_lasso_meets_its_optimality_conditions() -> None:
    """The gradient of a group that acts has the penalty's length and its direction; of others less.

    Checked on a made-up problem whose planted groups are found.
    """
    rng = np.random.default_rng(0)
    A = rng.normal(size=(200, 12))
    truth = np.zeros((5, 3, 12))
    truth[0, :, 4:8], truth[3, :, :4] = rng.normal(size=(3, 4)), rng.normal(size=(3, 4))
    D = np.einsum("nf,icf->nic", A, truth) + 0.01 * rng.normal(size=(200, 5, 3))
    penalty = 0.05
    P = blend_shapes.group_lasso(A, D, 4, penalty)
    acts = np.linalg.norm(P.reshape(5, 3, 3, 4), axis=(1, 3)) > 0
    assert acts.tolist() == (np.abs(truth.reshape(5, 3, 3, 4)).max(axis=(1, 3)) > 0).tolist()
    left = D - np.einsum("nf,icf->nic", A, P)
    gradient = np.einsum("nf,nic->icf", A, left).reshape(5, 3, 3, 4) / 200
    sizes = np.linalg.norm(gradient, axis=(1, 3))
    assert_allclose(sizes[acts], penalty, rtol=3e-4)
    assert (sizes[~acts] < penalty).all()
    again = blend_shapes.refitted(A, D, P)
    assert blend_shapes.nonzero_share(again) == blend_shapes.nonzero_share(P) == 2 / 15
    assert_allclose(again, truth, atol=0.01)


def test_predictors_are_ranked_as_in_the_lectures() -> None:
    plan = blend_shapes.PredictorPlan("small", 120, validation=20, test=24, examples=40, seed=3)
    study = blend_shapes.predictor_study(plan, None, silent)
    mean = {result.name: result.accuracy.mean for result in study.results}
    assert list(mean.values()) == sorted(mean.values())
    assert mean["LBS + rotation elements (SMPL)"] < mean["LBS + theta"]
    assert mean["LBS + theta"] < mean[blend_shapes.LINEAR] < mean["rigid parts"]
    assert mean["rigid parts"] < mean["quadratic in theta, no bones"]
    assert mean["quadratic in theta, no bones"] < mean["linear in theta, no bones"]
    assert mean["dual quaternions (DQB)"] < mean[blend_shapes.LINEAR]
    linear = next(row for row in blend_shapes.table(study).rows if row[0] == blend_shapes.LINEAR)
    assert linear[5] == "0%"
    rows = study.by_distance_penalty
    assert (np.diff([row.share for row in rows]) < 0).all()
    assert (np.diff([row.training_rms for row in rows]) > 0).all()
    assert rows[0].share > 4 * rows[-1].share


# Vertices or triangles.


@pytest.fixture(scope="module")
def trained() -> triangles.TriangleStudy:
    plan = triangles.TrianglePlan(people=14, subjects=3, poses=5, held_out=5, test=5)
    options = triangles.TrainingOptions(
        lambda sigmas: Plan(triangles.near(sigmas).stages[:2], 2),
        (0.01, 0.1),
        TriangleOptions(1, (1e-1, 1e-2), Lsqr(1e-2), Lsqr(1e-2)),
    )
    weights = teacher_of(SMALL).weights
    people = triangles.People(many_people(0)[:14], many_people(1)[:5], SMALL, weights)
    registered = triangles.register(plan, people, None)
    assert registered.posed.subject.tolist() == [i % 3 for i in range(15)]
    again = triangles.register(plan, people, None)
    np.testing.assert_array_equal(again.posed.vertices, registered.posed.vertices)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(triangles, "timings", lambda *_: [])
        return triangles.compare_models(plan, registered, silent, options)


def test_triangle_models_are_chosen_by_error(trained: triangles.TriangleStudy) -> None:
    assert list(trained.choices) == list(triangles.SHOWN)
    for choice in trained.choices.values():
        assert choice.errors[choice.tried.index(choice.chosen)] == min(choice.errors)
        assert max(choice.errors) < 60  # mm: nothing went astray


# Fitting and learning in a loop.


def test_costs_of_rounds_never_rise() -> None:
    pytest.importorskip("sklearn")
    plan = spin_loop.LoopPlan(6, 3, rounds=2, views=30, passes=4, hidden=24, body="small")
    study = spin_loop.loop_study(plan, None, silent)
    assert [one.number for one in study.rounds] == [0, 1, 2]
    costs = [one.cost for one in study.rounds]
    assert costs == sorted(costs, reverse=True)
    for before, after in zip(study.rounds, study.rounds[1:], strict=False):
        assert (after.cost < before.cost) == (after.replaced > 0)
        changed = sum(a != b for a, b in zip(before.kept.each, after.kept.each, strict=True))
        assert changed == after.replaced
        assert after.alone is not None
        assert after.begun is not None
        assert len(after.alone.each) == len(after.begun.each) == 3
    assert study.best.mean < 100  # mm: a fit that begins at the truth stays near
    rows = spin_loop.tables(study)[0].rows
    assert [row[3] for row in rows] == [str(one.replaced) for one in study.rounds]


# Plans and folders.


@pytest.mark.parametrize(
    ("plan", "text"),
    [
        (partial(blend_shapes.PredictorPlan, examples=5), "at least 10"),
        (partial(blend_shapes.PredictorPlan, test=3), "need at least 20 poses"),
        (partial(triangles.TrianglePlan, "tiny"), "no body 'tiny'; there are default, small, full"),
        (partial(triangles.TrianglePlan, people=5), "5 people at most 4 shape directions"),
        (partial(triangles.TrianglePlan, subjects=300), "300 subjects cannot be taken from 200"),
        (partial(triangles.TrianglePlan, test=4), "5 test meshes"),
        (partial(coregistration.TogetherPlan, people=1), "two people"),
        (partial(coregistration.TogetherPlan, (4,)), "scans rise from 6 on, not 4"),
        (partial(coregistration.TogetherPlan, holes=(-1,)), "holes rise from 0 on, not -1"),
        (partial(spin_loop.LoopPlan, rounds=0), "rounds is a number from 1 on, not 0"),
    ],
)
def test_impossible_plans_are_refused(plan: Callable[[], object], text: str) -> None:
    with pytest.raises(BadArgument, match=text):
        plan()


def test_basins_say_which_starts_end_at_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = ["--body", "small", "--points", "80", "--step", "90", "--noise", "0"]
    asked = ["study", *small, "--axes", "y", "x,z", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", asked)
    icp_basins.main()
    folder = tmp_path / "icp-basins"
    assert {path.name for path in folder.glob("*.png")} == {"basins.png", "basins-x-z.png"}
    with (folder / "starts-y.csv").open() as file:
        rows = {row["y_deg"]: row for row in csv.DictReader(file)}
    assert [*rows] == ["-90", "0", "90", "180"]
    assert rows["0"]["found"] == "yes"
    assert float(rows["0"]["off_mm"]) < 0.1
    assert len((folder / "starts-x-z.csv").read_text().splitlines()) == 17
    for axes, said in (("w", "no axis is called 'w'"), ("x,y,z", "one axis or two")):
        with pytest.raises((BadArgument, UnknownName), match=said):
            icp_basins.BasinPlan(axes=(axes,))
