"""The studies of a checkout: the laws of what they measure with, and a small run of each."""

import csv
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import workbench as wb
from builder.geometry import along_edges
from builder.ridge import RidgeSums, solve_ridge
from builder.triangle_learning import Lsqr
from examples.studies import (
    blend_shapes,
    coregistration,
    icp_basins,
    output,
    spin_loop,
    triangles,
)
from examples.studies.simulated_scans import errors, ratio, scanned_set
from examples.studies.triangle_alternation import TriangleOptions
from tests.bodies_made_up import random_body
from workbench.bodies.forward.skinning import unskinned
from workbench.bodies.forward.surface import count_features, rotation_vectors
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.geometry.solids import vertex_normals
from workbench.lectures.material.blend_shapes import (
    Correctives,
    PosedSurfaces,
    TrainingData,
    correctives,
    feature_matrix,
    with_blend_shapes,
)
from workbench.lectures.material.kernel_features import Examples, GaussianKernels, Powers, products
from workbench.lectures.material.teacher import body_on_teachers_rig, teacher_of
from workbench.lectures.material.tubes import tube
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.training.blocks import Plan

pytestmark = pytest.mark.thorough

SMALL = wb.load_body("small")
LBS = body_on_teachers_rig(SMALL)
README = Path(__file__).parents[1] / "examples" / "studies" / "README.md"
RESULTS = Path(__file__).parents[1] / "benchmarks" / "results"


def silent(line: str) -> None:
    pass


# Blend shapes.


@pytest.fixture(scope="module")
def data() -> TrainingData:
    rng, teacher = np.random.default_rng(0), teacher_of(SMALL)
    training, validation = (draw_poses(shipped_gaussian(), n, rng) for n in (160, 40))
    return TrainingData(
        LBS, PosedSurfaces.of(teacher, training), PosedSurfaces.of(teacher, validation)
    )


def many_people(seed: int) -> np.ndarray:
    """The small body's shapes, and bumps that no shape direction has: full rank."""
    rng = np.random.default_rng(seed)
    people = SMALL.vertices(betas=rng.normal(size=(24, 10)))
    middles = SMALL.template[rng.integers(SMALL.n_vertices, size=(24, 5))]
    apart = np.linalg.norm(SMALL.template[None, :, None] - middles[:, None], axis=-1)
    bumps = np.einsum("pnc,pca->pna", np.exp(-((apart / 0.1) ** 2)), rng.normal(size=(24, 5, 3)))
    return np.asarray(people + 0.01 * bumps)


@pytest.fixture(scope="module")
def wanted(data: TrainingData) -> Correctives:
    return data.correctives(LBS)


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


def test_correctives_give_the_teachers_surface(data: TrainingData) -> None:
    few = data.validation.some(slice(4))
    for skinning in (wb.linear_blend, wb.dual_quaternion_blend):
        body = replace(LBS, skinning=skinning)
        evaluations = zip(few.poses, few.vertices, correctives(body, few), strict=True)
        for pose, truth, offset in evaluations:
            posed = blend_shapes.Evaluation(body)
            posed._template = (body.template + offset).ravel()  # at the joints of the body itself
            assert_allclose(posed(pose), truth, atol=1e-10)
            assert_allclose(blend_shapes.Evaluation(body)(pose), body.vertices(pose), atol=1e-14)


@pytest.mark.parametrize("width", [0.5, 3.0])
def test_exact_interpolation_returns_examples(
    data: TrainingData, wanted: Correctives, width: float
) -> None:
    kernels = GaussianKernels(Examples(data.features(rotation_vectors)[0][:60], width))
    body = with_blend_shapes(LBS, kernels, kernels.interpolating(wanted.training[:60]))
    A = feature_matrix(LBS, kernels, data.training.poses[:60])
    found = np.einsum("nf,icf->nic", A, body.posedirs)
    assert_allclose(found, wanted.training[:60], rtol=0, atol=1e-12)
    posed = body.vertices(data.training.poses[:5])
    assert_allclose(posed, data.training.vertices[:5], rtol=0, atol=1e-11)


def test_predictors_are_fitted_like_smpl(data: TrainingData, wanted: Correctives) -> None:
    kernels = GaussianKernels(Examples(data.features(rotation_vectors)[0][:12], 3.0))
    body = with_blend_shapes(LBS, kernels, kernels.interpolating(wanted.training[:12]))
    pose = 0.8 * data.validation.poses[0]
    truth = body.start() | {"pose": pose, "trans": np.array([0.1, 0, 0.2])}
    points = body.points(*(block.symbol for block in body.blocks()))
    vertices = wb.residuals.vertices(points, body.vertices(**truth), sigma=0.001)
    solution = wb.solve(wb.Problem([vertices], free=["pose", "trans"]), body.start())
    assert solution.converged
    assert_allclose(solution.values["pose"], truth["pose"], atol=1e-7)


def ridge(A: np.ndarray, D: np.ndarray, value: float) -> np.ndarray:
    """Ridge regression with all features at all vertices."""
    return solve_ridge(RidgeSums.of([(A, D)]), np.ones((D.shape[1], A.shape[1]), bool), value)


def test_polynomials_are_recovered_without_bones() -> None:
    body, rng = random_body(n_joints=3), np.random.default_rng(0)
    for features in (rotation_vectors, Powers(3), products):
        P = rng.normal(size=(30, 3, count_features(features, 3, 0)))
        truth = replace(body, features=features, posedirs=P, skinning=unskinned)
        poses = rng.normal(size=(80, 3, 3))
        A = feature_matrix(truth, features, poses)
        assert_allclose(ridge(A, truth.vertices(poses) - truth.template, 1e-14), P, atol=1e-7)
    assert [count_features(f, 24, 0) for f in (Powers(3), products)] == [207, 69 + 69 * 70 // 2]


def test_ridge_meets_its_normal_equations() -> None:
    rng = np.random.default_rng(0)
    D = rng.normal(size=(20, 7, 3))
    for F in (5, 60):
        A = rng.normal(size=(20, F))
        P = ridge(A, D, 0.1)
        left = D.reshape(20, -1) - A @ P.reshape(21, F).T
        assert np.abs(A.T @ left - 2 * P.reshape(21, F).T).max() < 1e-12
        everywhere = blend_shapes.local_ridge(A, D, np.zeros((1, 7)), 1.0, 0.1)
        assert_allclose(everywhere, P, atol=1e-12)


def test_distances_along_a_tube_are_lengths() -> None:
    body = tube(rings=21)
    ring = 10 * 32 + np.arange(32)
    (away,) = along_edges(body.template, body.faces, [ring])
    assert_allclose(away[: 21 * 32], np.abs(body.template[: 21 * 32, 0]), atol=1e-12)
    assert_allclose(away[21 * 32 :], 0.3 + 0.05, atol=1e-12)
    apart, _ = along_edges(np.vstack([body.template, [[9, 9, 9]]]), body.faces, [ring, ring])
    assert apart[-1] == np.inf
    assert blend_shapes.joint_distances(body).shape == (1, len(body.template))


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


def test_vertices_explain_as_much_as_triangles(trained: triangles.TriangleStudy) -> None:
    """By the theorem of Eckart and Young, for the people from whom both were learned."""
    vertices, stitched = (trained.explained[f"{n}, training"].share for n in triangles.BASES)
    assert (vertices - stitched > -1e-12).all()
    smpl = next(result for result in trained.results if result.model == "SMPL")
    assert smpl.gap < 1e-10  # mm: SMPL adds what shape and pose do
    assert any(f"{smpl.rms:.2f}" in row for row in triangles.tables(trained)[0].rows)


@pytest.mark.parametrize("body", [SMALL, blend_scape(SMALL)], ids=lambda body: body.name)
def test_bodies_fit_meshes_of_their_own(body: wb.SkinnedBody | TriangleBody) -> None:
    rng = np.random.default_rng(2)
    betas, poses = rng.normal(size=(2, 10)), rng.normal(scale=0.3, size=(2, 24, 3))
    meshes = body.vertices(poses, betas, rng.normal(size=(2, 3)))
    fits, away = triangles.held_out_fits(body, SMALL, meshes)
    assert 1e3 * away.max() < 0.5  # mm; the prior on betas shows
    assert_allclose(fits.betas, betas, atol=0.05)


# Scans apart and together.


def test_sets_begin_with_the_scans_of_smaller_ones() -> None:
    few, more = scanned_set(5, 2, 2, holes=3), scanned_set(5, 2, 3, holes=3)
    for j in range(2):
        assert_allclose(few.scans.read(j).points, more.scans.read(j).points, atol=0)
    first = more.some(2)
    assert_allclose(first.meshes, few.meshes, atol=0)
    assert first.subject.tolist() == [0, 1]
    assert scanned_set(5, 2, 2).seen.sum() > few.seen.sum()
    moved = few.meshes.copy()
    moved[0] += 0.003 * vertex_normals(few.meshes[0], few.faces)
    away = errors(few, moved)
    assert_allclose([away[what][0] for what in ("seen", "hidden", "normal")], 3.0, rtol=1e-9)
    assert away["tangential"][0] < 1e-6
    assert away["seen"][1] == 0


def test_ratio_has_an_interval_over_people() -> None:
    subject = np.array([0, 1, 0, 1])
    assert ratio([1, 1, 1, 1], [2, 2, 2, 2], subject) == (0.5, 0.5, 0.5)
    middle, low, high = ratio([1, 3, 1, 3], [2, 2, 2, 2], subject)
    assert (middle, low, high) == (1.0, 0.5, 1.5)  # half of all draws hold both people


def test_coregistration_table_is_the_results() -> None:
    known = json.loads((RESULTS / "together.json").read_text())
    cells = [coregistration.Cell(**one) for one in known["sets"]]
    text = " ".join(README.read_text().split())
    for row in coregistration.table(cells).rows:
        assert f"| {' | '.join(row).replace('%', ' %')} |" in text


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


def test_loop_table_is_the_results() -> None:
    known = json.loads((RESULTS / "loop.json").read_text())
    text = " ".join(README.read_text().split())
    for number, one in enumerate(known["rounds"]):
        begun = f"{one['begun']['mean']:.1f} " if one["begun"] else ""
        assert f"| {number} | {one['kept']['mean']:.1f} | {begun}|" in text


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


def test_study_reads_its_options_and_writes_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small = [
        "--body",
        "small",
        "--training",
        "40",
        "--validation",
        "20",
        "--test",
        "20",
        "--examples",
        "10",
    ]
    monkeypatch.setattr(sys, "argv", ["study", *small, "--out", str(tmp_path)])
    blend_shapes.main()
    folder = tmp_path / "blendshapes"
    written = json.loads((folder / "summary.json").read_text())
    assert written["n_test"] == 20
    assert written["plan"]["body"] == "small"
    assert "linear blending (LBS)" in (folder / "tables.txt").read_text()
    assert len(list(folder.glob("*.png"))) == 6
    monkeypatch.setattr(sys, "argv", ["study", "--scans", "12", "13", "--people", "1"])
    with pytest.raises(SystemExit):
        output.arguments(coregistration.TogetherPlan, "")
    assert "two people" in capsys.readouterr().err


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
    plan = icp_basins.BasinPlan("small", ("x,z",), 90.0, points=80)
    (one,) = icp_basins.basin_maps(plan)
    x, y, errors = icp_basins.error_grid(one)
    assert errors.shape == (len(x), len(y)) == (4, 4)
    assert errors[1, 1] == one.turned[(one.angles == 0).all(axis=1)][0]
    for axes, said in (("w", "no axis is called 'w'"), ("x,y,z", "one axis or two")):
        with pytest.raises((BadArgument, UnknownName), match=said):
            icp_basins.BasinPlan(axes=(axes,))
