"""All predictors of blend shapes, fitted to the same data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody, dual_quaternion_blend
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.forward.features import (
    Features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
)
from workbench.bodies.forward.polynomial_features import Powers, products
from workbench.studies.blend_shapes.evaluation import Accuracy
from workbench.studies.blend_shapes.locality import joint_distances, local_ridge
from workbench.studies.blend_shapes.posed_surfaces import with_blend_shapes
from workbench.studies.blend_shapes.sparsity import group_lasso, refitted
from workbench.studies.blend_shapes.training_data import TrainingData
from workbench.studies.pages import Report

DISTANCE_PENALTY = 0.1  # per m^2 and pose: far blend shapes shrink, the error hardly grows
GROUP_PENALTY = 1e-4  # m: leaves about one number in fourteen
LINEAR = "linear blending (LBS)"
WITHOUT_BONES: Mapping[str, Features] = {
    "linear in theta, no bones": rotation_vectors,
    "cubic in theta, no bones": Powers(3),
    "quadratic in theta, no bones": products,
}
LINEAR_IN: Mapping[str, Features] = {
    "LBS + theta": rotation_vectors,
    "LBS + quaternions": quaternion_elements,
    "LBS + rotation elements (SMPL)": rotation_elements,
}
NORMALISED, INTERPOLATION = "LBS + normalised kernel", "LBS + exact RBF"


@dataclass(frozen=True, eq=False)
class Predictor:
    """A way of predicting the posed surface: a body like any other.

    Attributes:
        name: what it is called in tables and figures.
        body: predicts the surface of its mean person from the pose.
        parameters: how many numbers were fitted, beside template and weights, and are not zero.
    """

    name: str
    body: SkinnedBody
    parameters: int


@dataclass(frozen=True)
class Result:
    """What was measured of one predictor.

    Attributes:
        name: the predictor's.
        parameters: the predictor's, see `Predictor`.
        accuracy: its distances to the teacher in the test poses, and its time.
    """

    name: str
    parameters: int
    accuracy: Accuracy


def fit_predictors(data: TrainingData, n_examples: int, report: Report) -> Iterator[Predictor]:
    """Every predictor, each fitted when it is first used; two interpolate `n_examples` poses."""
    body = data.body
    linear = without_pose_blend_shapes(body)
    dual = replace(linear, skinning=dual_quaternion_blend)
    yield Predictor(LINEAR, linear, 0)
    yield Predictor("rigid parts", without_blend_weights(linear), 0)
    yield Predictor("dual quaternions (DQB)", dual, 0)
    for name, features in WITHOUT_BONES.items():
        report(name)
        found = data.fit_without_bones(features)
        yield Predictor(name, found, found.posedirs.size + found.template.size)
    report("computing the correctives of linear blending")
    wanted = data.correctives(linear)

    def predictor(name: str, features: Features, posedirs: Array, more: int = 0) -> Predictor:
        body = with_blend_shapes(linear, features, posedirs)
        return Predictor(name, body, int(np.count_nonzero(posedirs)) + more)

    for name, features in LINEAR_IN.items():
        report(name)
        posedirs, ridge = data.fit(features, wanted)
        yield predictor(name, features, posedirs)
    report("LBS + rotation elements, near")  # with the last ridge, that of all rotation elements
    A, distances = data.features(rotation_elements)[0], joint_distances(body)
    near = local_ridge(A, wanted.training, distances, DISTANCE_PENALTY, ridge)
    yield predictor("LBS + rotation elements, near (MANO)", rotation_elements, near)
    report("LBS + quaternions, sparse")
    A = data.features(quaternion_elements)[0]
    chosen = group_lasso(A, wanted.training, 4, GROUP_PENALTY)
    sparse = refitted(A, wanted.training, chosen)
    yield predictor("LBS + quaternions, sparse (STAR)", quaternion_elements, sparse)
    report(f"LBS + {n_examples} examples")
    blended, posedirs = data.blended_examples(n_examples, wanted)
    places = blended.examples.places.size
    yield predictor(f"{NORMALISED} of {n_examples} examples", blended, posedirs, places)
    exact, posedirs = data.interpolation(n_examples, wanted)
    yield predictor(f"{INTERPOLATION} of {n_examples} examples", exact, posedirs, places)
    report("DQB + rotation elements")
    posedirs, _ = data.fit(rotation_elements, data.correctives(dual))
    name, body = "DQB + rotation elements", with_blend_shapes(dual, rotation_elements, posedirs)
    yield Predictor(name, body, int(np.count_nonzero(posedirs)))


def ranked(results: Sequence[Result]) -> list[Result]:
    """The results with the least mean distance first."""
    return sorted(results, key=lambda result: result.accuracy.mean)


def repaired(result: Result, results: Sequence[Result]) -> float:
    """The share of linear blending's mean distance that is gone; negative where it has grown."""
    linear = next(other for other in results if other.name == LINEAR)
    return 1 - result.accuracy.mean / linear.accuracy.mean
