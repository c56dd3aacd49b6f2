"""All predictors of blend shapes, fitted to the same data."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.bodies import SkinnedBody, dual_quaternion_blend
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.forward import surface
from workbench.bodies.forward.features import (
    Features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
)
from workbench.studies.blend_shapes.kernel_features import Powers, products
from workbench.studies.blend_shapes.sparsity import (
    group_lasso,
    joint_distances,
    local_ridge,
    nonzero_share,
    refitted,
)
from workbench.studies.blend_shapes.training_data import (
    PosedSurfaces,
    TrainingData,
    with_blend_shapes,
)
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
SPARSE_BELOW = 0.2  # of all numbers: there a sparse product is the faster one


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


@dataclass(frozen=True)
class Accuracy:
    """Distances to the teacher's vertices over all test poses.

    Attributes:
        mean: in mm.
        rms: in mm.
        largest: in mm.
        milliseconds: the least time that one pose took.
    """

    mean: float
    rms: float
    largest: float
    milliseconds: float


class Evaluation:
    """A function from pose (K, 3) rad to surface (N, 3) m, of the mean person at the origin."""

    def __init__(self, body: SkinnedBody) -> None:
        pose, rest = cs.MX.sym("pose", 3, body.n_joints), cs.MX.sym("rest", 3, body.n_vertices)
        at = surface.posture(body, pose, cs.MX.zeros(body.n_betas))
        G, _ = surface.motions(body, at)
        self._features = cs.Function("features", [pose], [cs.densify(body.features(at))])
        skinned = body.skinning(rest, G, surface.weights(body))
        self._skinned = cs.Function("skinned", [pose, rest], [skinned])
        flat, self._moved = body.posedirs.reshape(3 * body.n_vertices, -1), body.posedirs.any()
        sparse = self._moved and nonzero_share(flat) < SPARSE_BELOW
        self._posedirs = csr_array(flat) if sparse else flat
        self._template = body.template.ravel()

    def __call__(self, pose: Array) -> Array:
        """The surface (N, 3) m."""
        rest = self._template
        if self._moved:
            rest = rest + self._posedirs @ np.asarray(self._features(pose.T)).ravel()
        return np.asarray(self._skinned(pose.T, rest.reshape(-1, 3).T)).T


def accuracy(body: SkinnedBody, test: PosedSurfaces) -> Accuracy:
    """A body's distances to the teacher's surfaces in the test poses."""
    evaluate = Evaluation(body)
    evaluate(test.poses[0])
    distances, seconds = [], []
    for pose, truth in zip(test.poses, test.vertices, strict=True):
        began = time.perf_counter()
        found = evaluate(pose)
        seconds.append(time.perf_counter() - began)
        distances.append(1e3 * np.linalg.norm(found - truth, axis=1))
    return Accuracy(
        mean=float(np.mean(distances)),
        rms=float(np.sqrt(np.mean(np.square(distances)))),
        largest=float(np.max(distances)),
        milliseconds=1e3 * min(seconds),
    )
