"""All predictors taught the same lesson, and how far each is from the teacher in poses unseen."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody, dual_quaternion_blend
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.features import (
    Features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
)
from workbench.bodies.polynomials import Powers, products, unskinned
from workbench.bodies.scattered import Examples, Gaussians, Shares, shapes_as_directions
from workbench.training.blend_shapes.evaluation import Evaluation
from workbench.training.blend_shapes.lesson import Lesson, Report, bulges, feature_matrix, taught
from workbench.training.blend_shapes.locality import joint_distances, local_ridge_at
from workbench.training.blend_shapes.regression import RIDGES, best, left_over, ridge
from workbench.training.blend_shapes.sparsity import group_lasso, refitted

Array = NDArray[np.float64]
PRICE_OF_DISTANCE = 0.1  # per m^2 and pose: far blend shapes cost, the error hardly grows
PRICE_OF_GROUPS = 1e-4  # m: leaves about one number in fourteen
WIDTHS = (0.15, 0.25, 0.5, 1.0, 2.0, 4.0)  # of kernels, in median distances between two poses
LINEAR = "linear blending (LBS)"
CURVES: Mapping[str, Features] = {
    "linear in theta, no bones": rotation_vectors,
    "cubic in theta, no bones": Powers(3),
    "quadratic in theta, no bones": products,
}
LINEAR_IN: Mapping[str, Features] = {
    "LBS + theta": rotation_vectors,
    "LBS + quaternions": quaternion_elements,
    "LBS + rotation elements (SMPL)": rotation_elements,
}
Kernel = TypeVar("Kernel", Shares, Gaussians)


@dataclass(frozen=True, eq=False)
class Contender:
    """A way of predicting the posed surface: a body like any other."""

    name: str
    body: SkinnedBody
    learned: int  # numbers that are not zero, beside template and weights


@dataclass(frozen=True)
class Result:
    """Distances to the teacher's vertices over all test poses, mm; and a pose's least time."""

    name: str
    learned: int
    mean: float
    rms: float
    largest: float
    milliseconds: float


@dataclass(frozen=True, eq=False)
class Shapes:
    """What is to be predicted in the lesson (n, N, 3) m, and in the trial."""

    lesson: Array
    trial: Array


@dataclass(frozen=True, eq=False)
class School:
    """What is learned from, and what choices are made on; nothing is ever tested on either."""

    body: SkinnedBody
    lesson: Lesson
    trial: Lesson

    def features(self, features: Features) -> tuple[Array, Array]:
        """(n, F) of the lesson and of the trial."""
        one, other = (
            feature_matrix(self.body, features, some.poses) for some in (self.lesson, self.trial)
        )
        return one, other

    def bulges(self, student: SkinnedBody) -> Shapes:
        """What its skinning gets wrong in the lesson and in the trial."""
        return Shapes(bulges(student, self.lesson), bulges(student, self.trial))

    def fit(self, features: Features, shapes: Shapes) -> tuple[Array, float]:
        """Posedirs (N, 3, F) by ridge regression, and its price, chosen on the trial."""
        A, A_trial = self.features(features)
        return _ridge_by_trial(A, A_trial, shapes)

    def curve(self, features: Features) -> SkinnedBody:
        """v = c + P f(theta), without bones."""
        A, A_trial = self.features(features)
        middle, mean = A.mean(axis=0), self.lesson.posed.mean(axis=0)
        shapes = Shapes(self.lesson.posed - mean, self.trial.posed - mean)
        posedirs, _ = _ridge_by_trial(A - middle, A_trial - middle, shapes)
        constant = mean - posedirs @ middle
        plain = replace(self.body, template=constant, skinning=unskinned)
        return taught(plain, features, posedirs)

    def shares(self, n: int, shapes: Shapes) -> tuple[Shares, Array]:
        """Kernels of the first n examples, normalised, their width chosen on the trial."""
        directions = shapes_as_directions(shapes.lesson[:n])
        return self._by_trial([Shares(e) for e in self._examples(n)], lambda _: directions, shapes)

    def gaussians(self, n: int, shapes: Shapes) -> tuple[Gaussians, Array]:
        """Kernels of the first n examples, with directions that reproduce these exactly."""
        tried = [Gaussians(e) for e in self._examples(n)]
        return self._by_trial(tried, lambda kernel: kernel.exactly(shapes.lesson[:n]), shapes)

    def _examples(self, n: int) -> list[Examples]:
        places = self.features(rotation_vectors)[0][:n]
        away = np.linalg.norm(places[:300, None] - places[:300], axis=2)
        unit = float(np.median(away[np.triu_indices(len(away), 1)]))
        return [Examples(places, width * unit) for width in WIDTHS]

    def _by_trial(
        self, tried: list[Kernel], learned: Callable[[Kernel], Array], shapes: Shapes
    ) -> tuple[Kernel, Array]:
        found = [(kernel, learned(kernel)) for kernel in tried]

        def error(pair: tuple[Kernel, Array]) -> float:
            kernel, directions = pair
            A_trial = feature_matrix(self.body, kernel, self.trial.poses)
            return left_over(A_trial, shapes.trial, directions)

        return best(found, error)


def _ridge_by_trial(A: Array, A_trial: Array, shapes: Shapes) -> tuple[Array, float]:
    found = {price: ridge(A, shapes.lesson, price) for price in RIDGES}
    price = best(RIDGES, lambda p: left_over(A_trial, shapes.trial, found[p]))
    return found[price], price


def contenders(school: School, examples: int, report: Report) -> Iterator[Contender]:
    """One after the other, taught as they are asked for."""
    body = school.body
    linear = without_pose_blend_shapes(body)
    dual = replace(linear, skinning=dual_quaternion_blend)
    yield Contender(LINEAR, linear, 0)
    yield Contender("rigid parts", without_blend_weights(linear), 0)
    yield Contender("dual quaternions (DQB)", dual, 0)
    for name, features in CURVES.items():
        report(name)
        curve = school.curve(features)
        yield Contender(name, curve, curve.posedirs.size + curve.template.size)
    report("un-posing what linear blending gets wrong")
    shapes = school.bulges(linear)

    def contender(name: str, features: Features, posedirs: Array, more: int = 0) -> Contender:
        return Contender(name, taught(linear, features, posedirs), _nonzeros(posedirs) + more)

    for name, features in LINEAR_IN.items():
        report(name)
        posedirs, price = school.fit(features, shapes)
        yield contender(name, features, posedirs)
    report("LBS + rotation elements, near")  # with the price found last, for all rotation elements
    A, distances = school.features(rotation_elements)[0], joint_distances(body)
    yield contender(
        "LBS + rotation elements, near (MANO)",
        rotation_elements,
        local_ridge_at(A, shapes.lesson, distances, PRICE_OF_DISTANCE, price),
    )
    report("LBS + quaternions, sparse")
    A = school.features(quaternion_elements)[0]
    chosen = group_lasso(A, shapes.lesson, 4, PRICE_OF_GROUPS)
    sparse = refitted(A, shapes.lesson, chosen, 4)
    yield contender("LBS + quaternions, sparse (STAR)", quaternion_elements, sparse)
    report(f"LBS + {examples} examples")
    shares, directions = school.shares(examples, shapes)
    places = shares.examples.places.size
    yield contender(f"LBS + shares of {examples} examples", shares, directions, places)
    gaussians, directions = school.gaussians(examples, shapes)
    yield contender(f"LBS + exact RBF of {examples} examples", gaussians, directions, places)
    report("DQB + rotation elements")
    posedirs, _ = school.fit(rotation_elements, school.bulges(dual))
    yield Contender(
        "DQB + rotation elements",
        taught(dual, rotation_elements, posedirs),
        _nonzeros(posedirs),
    )


def _nonzeros(array: Array) -> int:
    return int(np.count_nonzero(array))


def measured(contender: Contender, test: Lesson) -> Result:
    """Its distances to the teacher's surface in the test poses."""
    evaluate = Evaluation(contender.body)
    evaluate(test.poses[0])
    total = squares = largest = 0.0
    seconds = []
    for pose, truth in zip(test.poses, test.posed, strict=True):
        began = time.perf_counter()
        found = evaluate(pose)
        seconds.append(time.perf_counter() - began)
        away = 1e3 * np.linalg.norm(found - truth, axis=1)
        total += float(away.mean())
        squares += float((away**2).mean())
        largest = max(largest, float(away.max()))
    n = len(test)
    return Result(
        contender.name,
        contender.learned,
        mean=total / n,
        rms=float(np.sqrt(squares / n)),
        largest=largest,
        milliseconds=1e3 * min(seconds),
    )


def ranked(results: Sequence[Result]) -> list[Result]:
    """The least mean distance first."""
    return sorted(results, key=lambda result: result.mean)


def repaired(result: Result, results: Sequence[Result]) -> float:
    """The share of the mean distance of linear blending that is gone; negative where it grew."""
    linear = next(other for other in results if other.name == LINEAR)
    return 1 - result.mean / linear.mean
