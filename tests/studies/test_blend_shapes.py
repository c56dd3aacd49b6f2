"""Predictors of blend shapes: their laws, and the one table that ranks them."""

from dataclasses import replace

import numpy as np
import pytest

import workbench as wb
from workbench.bodies.forward.features import (
    rotation_vectors,
)
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.studies.blend_shapes import questions
from workbench.studies.blend_shapes.kernel_features import (
    Examples,
    GaussianKernels,
)
from workbench.studies.blend_shapes.predictors import (
    LINEAR,
    Evaluation,
    ranked,
    repaired,
)
from workbench.studies.blend_shapes.study import PredictorPlan, PredictorStudy, predictor_study
from workbench.studies.blend_shapes.training_data import (
    Correctives,
    PosedSurfaces,
    TrainingData,
    correctives,
    feature_matrix,
    with_blend_shapes,
)
from workbench.synthetic.fine_weights import body_on_teachers_rig, teacher_of

pytestmark = pytest.mark.thorough

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


# The training data.


def test_body_on_teachers_rig_moves_as_the_teacher() -> None:
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


def test_correctives_give_the_teachers_surface(data: TrainingData) -> None:
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


@pytest.mark.parametrize("skinning", [wb.linear_blend, wb.dual_quaternion_blend])
def test_evaluation_is_the_body(skinning, data: TrainingData) -> None:  # type: ignore[no-untyped-def]
    body = replace(LBS, skinning=skinning)
    for pose in data.validation.poses[:3]:
        np.testing.assert_allclose(Evaluation(body)(pose), body.vertices(pose), atol=1e-14)


# Scattered data.


def examples(data: TrainingData, n: int, width: float) -> Examples:
    return Examples(data.features(rotation_vectors)[0][:n], width)


@pytest.mark.parametrize("width", [0.5, 3.0])
def test_exact_interpolation_returns_examples(
    data: TrainingData, wanted: Correctives, width: float
) -> None:
    kernels = GaussianKernels(examples(data, 60, width))
    body = with_blend_shapes(LBS, kernels, kernels.interpolating(wanted.training[:60]))
    A = feature_matrix(LBS, kernels, data.training.poses[:60])
    found = np.einsum("nf,icf->nic", A, body.posedirs)
    np.testing.assert_allclose(found, wanted.training[:60], rtol=0, atol=1e-12)
    posed = body.vertices(data.training.poses[:5])
    np.testing.assert_allclose(posed, data.training.vertices[:5], rtol=0, atol=1e-11)


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


# Near, and few.


def test_locality_and_error_follow_the_penalty(data: TrainingData, wanted: Correctives) -> None:
    rows = questions.by_distance_penalty(data, wanted, data.validation, lambda text: None)
    assert [row.penalty for row in rows] == list(questions.DISTANCE_PENALTIES)
    assert len(rows) == 5
    assert (np.diff([row.share for row in rows]) < 0).all()
    assert (np.diff([row.training_rms for row in rows]) > 0).all()
    assert rows[0].share > 4 * rows[-1].share


# The table.


def small_plan() -> PredictorPlan:
    return PredictorPlan("small", training=120, validation=20, test=24, examples=40, seed=3)


@pytest.fixture(scope="module")
def study() -> PredictorStudy:
    return predictor_study(small_plan(), None, lambda text: None)


def test_order_of_predictors_is_that_of_the_lectures(study: PredictorStudy) -> None:
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
