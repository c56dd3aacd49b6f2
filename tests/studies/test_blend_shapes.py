"""Predictors of blend shapes: their laws, and the one table that ranks them."""

import os
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.bodies.forward.features import (
    Powers,
    count_features,
    products,
    rotation_elements,
    rotation_vectors,
)
from workbench.bodies.forward.kernel_features import (
    Examples,
    GaussianKernels,
    NormalisedKernels,
    as_posedirs,
)
from workbench.bodies.forward.posing import Posing
from workbench.bodies.forward.skinning import unskinned
from workbench.errors import BadArgument, BadFile
from workbench.geometry.mesh_graph import along_edges
from workbench.lectures.material.tubes import tube
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.studies.blend_shapes import questions
from workbench.studies.blend_shapes.predictors import (
    LINEAR,
    Evaluation,
    accuracy,
    fit_predictors,
    ranked,
    repaired,
)
from workbench.studies.blend_shapes.sparsity import (
    far_share,
    group_lasso,
    joint_distances,
    local_ridge,
    nonzero_share,
    refitted,
)
from workbench.studies.blend_shapes.study import PredictorPlan, PredictorStudy, predictor_study
from workbench.studies.blend_shapes.training_data import (
    Correctives,
    PosedSurfaces,
    TrainingData,
    correctives,
    feature_matrix,
    rms_error,
    with_blend_shapes,
)
from workbench.synthetic.fine_weights import body_on_teachers_rig, teacher_of
from workbench.synthetic.skeleton import PARENTS, joint_positions, offsets, unskin
from workbench.training.ridge import Sums, solve_ridge

EMBEDDED = wb.load_body("small")
LBS = body_on_teachers_rig(EMBEDDED)


@pytest.fixture(scope="module")
def data() -> TrainingData:
    rng, teacher = np.random.default_rng(0), teacher_of(EMBEDDED)
    training, validation = (draw_poses(shipped_gaussian(), n, rng) for n in (160, 40))
    return TrainingData(
        LBS, PosedSurfaces.of(teacher, training), PosedSurfaces.of(teacher, validation)
    )


@pytest.fixture(scope="module")
def wanted(data: TrainingData) -> Correctives:
    return data.correctives(LBS)


def ridge(A: np.ndarray, D: np.ndarray, value: float) -> np.ndarray:
    """Ridge regression with all features at all vertices."""
    return solve_ridge(Sums.of([(A, D)]), np.ones((D.shape[1], A.shape[1]), bool), value)


# The training data.


def test_the_body_on_the_teachers_rig_moves_as_the_teacher_does() -> None:
    """So that blending of bones is all that it can get wrong: a turn of the root is no matter."""
    assert not LBS.posedirs.any()
    assert (LBS.weights > 0).sum(axis=1).max() <= 4
    np.testing.assert_allclose(LBS.weights.sum(axis=1), 1, atol=1e-12)
    teacher, poses = teacher_of(EMBEDDED), np.zeros((2, 24, 3))
    poses[0, 0], poses[1, 4] = (0.3, -0.7, 1.1), (1.0, 0, 0)
    away = [LBS.vertices(pose) - teacher.vertices(pose) for pose in poses]
    rooted, kneeling = np.linalg.norm(away, axis=2)
    assert rooted.max() < 1e-12
    far = LBS.weights[:, [0, 4, 7, 10]].sum(axis=1) == 0
    assert kneeling[far].max() < 1e-12
    assert 0.001 < kneeling.max() < 0.03


def test_there_is_no_teacher_for_other_bodies() -> None:
    with pytest.raises(BadFile, match=r"no teacher for body 'made-up'; .* default and small"):
        teacher_of(random_body())


def test_adding_the_correctives_gives_the_teachers_surface(data: TrainingData) -> None:
    few, dual = data.validation.some(slice(4)), replace(LBS, skinning=wb.dual_quaternion_blend)
    for body in (LBS, dual):
        for pose, truth, offset in zip(
            few.poses, few.vertices, correctives(body, few), strict=True
        ):
            bent = replace(body, template=LBS.template + offset)
            joints = LBS.J_regressor @ LBS.template
            held = replace(bent, J_regressor=_same_joints(bent, joints))
            np.testing.assert_allclose(held.vertices(pose), truth, atol=1e-10)


def _same_joints(body: wb.SkinnedBody, joints: np.ndarray):  # type: ignore[no-untyped-def]
    """Rows of sum one that regress these joints from the body's template."""
    from scipy.sparse import csr_array

    points = np.hstack([body.template, np.ones((len(body.template), 1))])
    wanted = np.hstack([joints, np.ones((len(joints), 1))])
    return csr_array(np.linalg.lstsq(points.T, wanted.T, rcond=None)[0].T)


def test_two_ways_of_un_posing_agree(data: TrainingData) -> None:
    teacher, few = teacher_of(EMBEDDED), data.validation.some(slice(3))
    for pose, offset in zip(few.poses, correctives(LBS, few), strict=True):
        world = Posing.of(pose[None], PARENTS).world[0]
        placed = joint_positions(world, teacher.joints)
        shifts = offsets(world, placed, teacher.joints)
        expected = unskin(teacher.vertices(pose), LBS.weights, world, shifts) - teacher.rest
        np.testing.assert_allclose(offset, expected, atol=1e-12)


@pytest.mark.parametrize("skinning", [wb.linear_blend, wb.dual_quaternion_blend])
def test_three_steps_are_the_body(skinning, data: TrainingData) -> None:  # type: ignore[no-untyped-def]
    body = replace(LBS, skinning=skinning)
    for pose in data.validation.poses[:3]:
        np.testing.assert_allclose(Evaluation(body)(pose), body.vertices(pose), atol=1e-14)


# Scattered data.


def examples(data: TrainingData, n: int, width: float) -> Examples:
    return Examples(data.features(rotation_vectors)[0][:n], width)


@pytest.mark.parametrize("width", [0.5, 1.5, 3.0])
def test_exact_interpolation_gives_every_example_back(
    data: TrainingData, wanted: Correctives, width: float
) -> None:
    kernels = GaussianKernels(examples(data, 60, width))
    body = with_blend_shapes(LBS, kernels, kernels.interpolating(wanted.training[:60]))
    A = feature_matrix(LBS, kernels, data.training.poses[:60])
    found = np.einsum("nf,icf->nic", A, body.posedirs)
    np.testing.assert_allclose(found, wanted.training[:60], rtol=0, atol=1e-12)
    posed = body.vertices(data.training.poses[:5])
    np.testing.assert_allclose(posed, data.training.vertices[:5], rtol=0, atol=1e-11)


def test_shares_are_a_partition_of_unity_and_find_the_example_as_they_narrow(
    data: TrainingData,
) -> None:
    poses = data.training.poses[:30]
    for width in (0.01, 0.5, 5.0):
        shares = feature_matrix(
            LBS, NormalisedKernels(examples(data, 30, width)), data.validation.poses
        )
        np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-12)
        assert (shares >= 0).all()
    off = [
        np.abs(
            feature_matrix(LBS, NormalisedKernels(examples(data, 30, w)), poses) - np.eye(30)
        ).max()
        for w in (2.0, 1.0, 0.5, 0.1)
    ]
    assert (np.diff(off) < 0).all()
    assert off[-1] < 1e-12


def test_far_from_all_examples_one_forgets_and_the_other_repeats(
    data: TrainingData, wanted: Correctives
) -> None:
    known = examples(data, 30, 1.5)
    directions = as_posedirs(wanted.training[:30])
    far = 1000 * data.validation.poses[:1]
    nothing = feature_matrix(LBS, GaussianKernels(known), far) @ directions.reshape(-1, 30).T
    assert not nothing.any()
    nearest = np.linalg.norm(known.places - far[0, 1:].ravel(), axis=1).argmin()
    found = feature_matrix(LBS, NormalisedKernels(known), far) @ directions.reshape(-1, 30).T
    np.testing.assert_array_equal(found.reshape(-1, 3), wanted.training[nearest])


def test_examples_that_cannot_be_told_apart_are_refused(
    data: TrainingData, wanted: Correctives
) -> None:
    twice = Examples(np.zeros((2, 69)), 1.0)
    with pytest.raises(BadArgument, match="2 examples cannot be told apart by kernels of width 1"):
        GaussianKernels(twice).interpolating(wanted.training[:2])
    with pytest.raises(BadArgument, match="must be positive, not 0"):
        Examples(np.zeros((2, 69)), 0)


def test_predictors_are_fitted_like_smpl(data: TrainingData, wanted: Correctives) -> None:
    kernels = GaussianKernels(examples(data, 12, 3.0))
    body = with_blend_shapes(LBS, kernels, kernels.interpolating(wanted.training[:12]))
    truth = body.start() | {
        "pose": 0.8 * data.validation.poses[0],
        "trans": np.array([0.1, 0, 0.2]),
    }
    points = body.points(*(block.symbol for block in body.blocks()))
    problem = wb.Problem(
        [wb.residuals.vertices(points, body.vertices(**truth), sigma=0.001)],
        free=["pose", "trans"],
    )
    solution = wb.solve(problem, body.start())
    assert solution.converged
    np.testing.assert_allclose(solution.values["pose"], truth["pose"], atol=1e-7)


# Functions of theta.


def test_without_bones_a_polynomial_is_found_again() -> None:
    body, rng = random_body(n_joints=3), np.random.default_rng(0)
    for features in (rotation_vectors, Powers(3), products):
        F = count_features(features, 3, 0)
        truth = replace(
            body, features=features, posedirs=rng.normal(size=(30, 3, F)), skinning=unskinned
        )
        poses = rng.normal(size=(80, 3, 3))
        A = feature_matrix(truth, features, poses)
        found = ridge(A, truth.vertices(poses) - truth.template, 1e-14)
        np.testing.assert_allclose(found, truth.posedirs, atol=1e-7)
    assert [count_features(f, 24, 0) for f in (Powers(3), products)] == [207, 69 + 69 * 70 // 2]


def test_small_and_large_normal_equations_agree() -> None:
    rng = np.random.default_rng(0)
    D = rng.normal(size=(20, 7, 3))
    for F in (5, 60):
        A = rng.normal(size=(20, F))
        found = ridge(A, D, 0.1)
        assert (
            np.abs(
                A.T @ (D.reshape(20, -1) - A @ found.reshape(21, F).T) - 2 * found.reshape(21, F).T
            ).max()
            < 1e-12
        )
        everywhere = local_ridge(A, D, np.zeros((1, 7)), 1.0, 0.1)
        np.testing.assert_allclose(everywhere, found, atol=1e-12)


def test_the_training_error_grows_with_the_ridge(data: TrainingData, wanted: Correctives) -> None:
    A = data.features(rotation_elements)[0]
    fits = [ridge(A, wanted.training, value) for value in (1e-4, 1e-3, 1e-2, 1e-1, 1)]
    assert (np.diff([rms_error(A, wanted.training, P) for P in fits]) > 0).all()
    assert (np.diff([np.linalg.norm(P) for P in fits]) < 0).all()


# Near, and few.


def test_distances_along_a_tube_are_lengths() -> None:
    body = tube(rings=21)
    ring = 10 * 32 + np.arange(32)
    (found,) = along_edges(body.template, body.faces, [ring])
    along = np.abs(body.template[: 21 * 32, 0])
    np.testing.assert_allclose(found[: 21 * 32], along, atol=1e-12)
    np.testing.assert_allclose(found[21 * 32 :], 0.3 + 0.05, atol=1e-12)
    apart, _ = along_edges(np.vstack([body.template, [[9, 9, 9]]]), body.faces, [ring, ring])
    assert apart[-1] == np.inf
    assert joint_distances(body).shape == (1, len(body.template))


def test_joints_are_near_their_own_skin() -> None:
    body = wb.load_body("default")
    distances = joint_distances(body)
    assert np.isfinite(distances).all()
    joint = {name: k for k, name in enumerate(body.joint_names[1:])}
    wrist, knee = body.template[:, 0].argmax(), body.template[:, 1].argmin()
    assert distances[joint["left_wrist"], wrist] < 0.25 < distances[joint["left_knee"], wrist]
    assert distances[joint["left_wrist"], knee] > 1
    straight = np.linalg.norm(body.template - body.joints()[1:, None], axis=2)
    assert (distances > straight - 0.25).all()  # a joint is a ring around a point inside


def test_locality_and_error_follow_the_penalty_strictly(
    data: TrainingData, wanted: Correctives
) -> None:
    rows = questions.by_distance_penalty(data, wanted, data.validation, lambda text: None)
    assert [row.penalty for row in rows] == list(questions.DISTANCE_PENALTIES)
    assert len(rows) == 5
    assert (np.diff([row.share for row in rows]) < 0).all()
    assert (np.diff([row.training_rms for row in rows]) > 0).all()
    assert rows[0].share > 4 * rows[-1].share


def test_no_penalty_on_distance_is_plain_ridge(data: TrainingData, wanted: Correctives) -> None:
    A, distances = data.features(rotation_elements)[0], joint_distances(LBS)
    local = local_ridge(A, wanted.training, distances, 0.0, 1e-3)
    np.testing.assert_allclose(local, ridge(A, wanted.training, 1e-3), atol=1e-12)
    assert 0 < far_share(local, distances) < 1


def test_fewer_numbers_act_and_more_error_is_left_as_groups_cost_more(
    data: TrainingData, wanted: Correctives
) -> None:
    rows = questions.by_group_penalty(data, wanted, data.validation, lambda text: None)
    assert (np.diff([row.share for row in rows]) < 0).all()
    assert (np.diff([row.training_rms for row in rows]) > 0).all()


def test_the_group_lasso_meets_its_conditions_of_optimality() -> None:
    """The gradient of a group that acts has the penalty's length and its direction; of others less.

    Checked on a made-up problem whose planted groups are found.
    """
    rng = np.random.default_rng(0)
    A = rng.normal(size=(200, 12))
    truth = np.zeros((5, 3, 12))
    truth[0, :, 4:8], truth[3, :, :4] = rng.normal(size=(3, 4)), rng.normal(size=(3, 4))
    D = np.einsum("nf,icf->nic", A, truth) + 0.01 * rng.normal(size=(200, 5, 3))
    penalty = 0.05
    found = group_lasso(A, D, 4, penalty)
    acts = np.linalg.norm(found.reshape(5, 3, 3, 4), axis=(1, 3)) > 0
    assert acts.tolist() == (np.abs(truth.reshape(5, 3, 3, 4)).max(axis=(1, 3)) > 0).tolist()
    left = D - np.einsum("nf,icf->nic", A, found)
    pull = np.einsum("nf,nic->icf", A, left).reshape(5, 3, 3, 4) / 200
    sizes = np.linalg.norm(pull, axis=(1, 3))
    np.testing.assert_allclose(sizes[acts], penalty, rtol=3e-4)
    assert (sizes[~acts] < penalty).all()
    again = refitted(A, D, found)
    assert nonzero_share(again) == nonzero_share(found) == 2 / 15
    np.testing.assert_allclose(again, truth, atol=0.01)


# The table.


def small_plan() -> PredictorPlan:
    return PredictorPlan("small", training=120, validation=20, test=24, examples=40, seed=3)


@pytest.fixture(scope="module")
def study() -> PredictorStudy:
    return predictor_study(small_plan(), None, lambda text: None)


@pytest.mark.thorough
def test_it_comes_from_its_seeds(study: PredictorStudy) -> None:
    rng = np.random.default_rng(3)
    training, validation, test = (draw_poses(shipped_gaussian(), n, rng) for n in (120, 20, 24))
    teacher = teacher_of(EMBEDDED)
    again = TrainingData(
        LBS, PosedSurfaces.of(teacher, training), PosedSurfaces.of(teacher, validation)
    )
    seen = PosedSurfaces.of(teacher, test)
    by_name = {result.name: result for result in study.results}
    assert len(by_name) == 14
    for predictor in islice(fit_predictors(again, 40, lambda text: None), 10):
        before = by_name[predictor.name]
        found = accuracy(predictor.body, seen)
        expected = before.accuracy.mean, before.accuracy.largest
        assert (found.mean, found.largest) == pytest.approx(expected, rel=1e-9)
        assert predictor.parameters == before.parameters
        away = np.linalg.norm(predictor.body.vertices(test) - seen.vertices, axis=2)
        assert 1e3 * away.mean() == pytest.approx(found.mean, rel=1e-9)
    assert study.n_test == 24
    assert "shipped pose prior" in study.test


def test_the_order_is_that_of_the_lectures(study: PredictorStudy) -> None:
    mean = {result.name: result.accuracy.mean for result in study.results}
    assert list(mean.values()) == sorted(mean.values())
    assert study.results == tuple(ranked(study.results))
    smpl = mean["LBS + rotation elements (SMPL)"]
    assert smpl < mean["LBS + theta"] < mean[LINEAR] < mean["rigid parts"]
    assert mean["rigid parts"] < mean["quadratic in theta, no bones"]
    assert mean["quadratic in theta, no bones"] < mean["linear in theta, no bones"]
    assert mean["dual quaternions (DQB)"] < mean[LINEAR]
    linear = next(r for r in study.results if r.name == LINEAR)
    assert repaired(linear, study.results) == 0


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (
            {"examples": 300, "training": 200},
            "300 examples cannot be taken from 200 training poses",
        ),
        ({"examples": 5}, "at least 10"),
        ({"test": 3}, "need at least 20 poses"),
    ],
)
def test_a_plan_that_cannot_be_carried_out_is_refused(wrong: dict[str, int], text: str) -> None:
    with pytest.raises(BadArgument, match=text):
        PredictorPlan(**wrong)  # type: ignore[arg-type]


@pytest.mark.thorough
@pytest.mark.skipif(
    "WORKBENCH_MOCAP" not in os.environ,
    reason="set WORKBENCH_MOCAP to the recording cmu_smpl_10fps.npz",
)
def test_on_real_poses_the_order_is_the_same() -> None:
    found = predictor_study(PredictorPlan(), Path(os.environ["WORKBENCH_MOCAP"]), lambda text: None)
    assert found.n_test >= 300
    mean = {result.name: result.accuracy.mean for result in found.results}
    smpl, linear = mean["LBS + rotation elements (SMPL)"], mean[LINEAR]
    assert smpl < mean["LBS + theta"] < linear
    assert linear == pytest.approx(1.84, abs=0.01)  # as data/bodies/PROVENANCE.md has it
    assert smpl < linear / 4
    curves = [mean[f"{kind} in theta, no bones"] for kind in ("cubic", "linear")]
    assert linear < curves[0] < curves[1]
