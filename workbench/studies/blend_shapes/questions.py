"""How error, size and extrapolation of a predictor depend on a single choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.features import Features, quaternion_elements, rotation_elements
from workbench.studies.blend_shapes.predictors import (
    INTERPOLATION,
    LINEAR_IN,
    NORMALISED,
    Accuracy,
    accuracy,
)
from workbench.studies.blend_shapes.sparsity import (
    far_share,
    group_lasso,
    joint_distances,
    local_ridge,
    nonzero_share,
    refitted,
)
from workbench.studies.blend_shapes.training_data import (
    Correctives,
    PosedSurfaces,
    TrainingData,
    feature_matrix,
    rms_error,
    rms_length,
    with_blend_shapes,
)
from workbench.studies.pages import Report
from workbench.training.estimate import bent

DISTANCE_PENALTIES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # per m^2 and pose
GROUP_PENALTIES = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3)  # m
RIDGE = 1e-3  # per pose, of all blend shapes beside the penalty on distance
EXAGGERATED = 20  # poses that are multiplied by FACTORS
FACTORS = np.linspace(0, 6, 25)
TURNS = np.radians(np.arange(0, 721, 5))


@dataclass(frozen=True)
class ByExamples:
    """The test of interpolation between n examples.

    Attributes:
        n: how many examples there are.
        normalised: the errors with normalised kernels.
        exact: the errors with kernels that reproduce the examples exactly.
    """

    n: int
    normalised: Accuracy
    exact: Accuracy


@dataclass(frozen=True)
class ByPenalty:
    """Blend shapes fitted with one penalty.

    Attributes:
        penalty: the strength of the penalty, per m^2 and pose, or in m.
        share: the remaining share of what is penalised: of the norm far from the joint, or of the
            numbers that are not zero.
        training_rms: in mm, the rms error of the blend shapes at rest in the training poses.
        test_mean: in mm, the mean distance of posed vertices in the test poses.
    """

    penalty: float
    share: float
    training_rms: float
    test_mean: float


def by_examples(
    data: TrainingData,
    wanted: Correctives,
    test: PosedSurfaces,
    counts: Sequence[int],
    report: Report,
) -> list[ByExamples]:
    """The cost and the errors of interpolation for growing numbers of examples."""
    rows = []
    for n in counts:
        report(f"  {n} examples")
        normalised, exact = (
            accuracy(with_blend_shapes(data.body, *fitted), test)
            for fitted in (data.blended_examples(n, wanted), data.interpolation(n, wanted))
        )
        rows.append(ByExamples(n, normalised, exact))
    return rows


def by_factor(data: TrainingData, wanted: Correctives, n_examples: int) -> dict[str, Array]:
    """What is predicted far from the training poses: the rms length of blend shapes, by predictor.

    In mm, at validation poses multiplied by each of FACTORS.
    """
    predictors: dict[str, tuple[Features, Array]] = {
        **_linear_predictors(data, wanted),
        f"{NORMALISED} of examples": data.blended_examples(n_examples, wanted),
        f"{INTERPOLATION} of examples": data.interpolation(n_examples, wanted),
    }
    poses = data.validation.poses[:EXAGGERATED]
    return {
        name: np.array([rms_length(_offsets(data, *fitted, f * poses)) for f in FACTORS])
        for name, fitted in predictors.items()
    }


def by_angle(data: TrainingData, wanted: Correctives, joint: str) -> dict[str, Array]:
    """The rms length of blend shapes, mm, at each of TURNS of a joint about the vertical."""
    poses = np.tile(data.body.bind_pose, (len(TURNS), 1, 1))
    poses[:, data.body.joint_names.index(joint), 1] = TURNS
    return {
        name: np.array([rms_length(each) for each in _offsets(data, *fitted, poses)])
        for name, fitted in _linear_predictors(data, wanted).items()
    }


def by_distance_penalty(
    data: TrainingData, wanted: Correctives, test: PosedSurfaces, report: Report
) -> list[ByPenalty]:
    """How far blend shapes reach with more and more of MANO's penalty, and what that costs."""
    A, distances = data.features(rotation_elements)[0], joint_distances(data.body)
    rows = []
    for penalty in DISTANCE_PENALTIES:
        report(f"  a penalty of {penalty:g} per square metre")
        posedirs = local_ridge(A, wanted.training, distances, penalty, RIDGE)
        training = 1e3 * rms_error(A, wanted.training, posedirs)
        tested = accuracy(with_blend_shapes(data.body, rotation_elements, posedirs), test)
        rows.append(ByPenalty(penalty, far_share(posedirs, distances), training, tested.mean))
    return rows


def by_group_penalty(
    data: TrainingData, wanted: Correctives, test: PosedSurfaces, report: Report
) -> list[ByPenalty]:
    """How many numbers of STAR's features are needed: fewer and fewer of them are kept."""
    A = data.features(quaternion_elements)[0]
    rows = []
    for penalty in GROUP_PENALTIES:
        report(f"  a penalty of {1e3 * penalty:g} mm for a joint at a vertex")
        posedirs = refitted(A, wanted.training, group_lasso(A, wanted.training, 4, penalty))
        training = 1e3 * rms_error(A, wanted.training, posedirs)
        tested = accuracy(with_blend_shapes(data.body, quaternion_elements, posedirs), test)
        rows.append(ByPenalty(penalty, nonzero_share(posedirs), training, tested.mean))
    return rows


def _linear_predictors(
    data: TrainingData, wanted: Correctives
) -> dict[str, tuple[Features, Array]]:
    return {name: (f, data.fit(f, wanted)[0]) for name, f in LINEAR_IN.items()}


def _offsets(data: TrainingData, features: Features, posedirs: Array, poses: Array) -> Array:
    """What pose blend shapes add to the rest surface, (n, N, 3) mm, in poses (n, K, 3) rad."""
    return 1e3 * bent(posedirs, feature_matrix(data.body, features, poses))
