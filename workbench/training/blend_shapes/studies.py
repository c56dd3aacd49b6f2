"""One question at a time: how error, size and reach of a predictor depend on a single choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.bodies.features import Features, quaternion_elements, rotation_elements
from workbench.training.blend_shapes.contest import LINEAR_IN, Contender, School, Shapes, measured
from workbench.training.blend_shapes.lesson import Lesson, Report, feature_matrix, taught
from workbench.training.blend_shapes.locality import far_share, joint_distances, local_ridge_at
from workbench.training.blend_shapes.regression import left_over
from workbench.training.blend_shapes.sparsity import acting_share, group_lasso, refitted

Array = NDArray[np.float64]
DISTANCE_PRICES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # per m^2 and pose
GROUP_PRICES = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3)  # m
LEAST_PRICE = 1e-3  # per pose, of all blend shapes
STRETCHED = 20  # poses that are gone on with, beyond what they are
FACTORS = np.linspace(0, 6, 25)
TURNS = np.radians(np.arange(0, 721, 5))


@dataclass(frozen=True)
class OfSize:
    """Interpolation between n examples: mean distance in the test, mm, and ms for one pose."""

    n: int
    shares: float
    shares_ms: float
    gaussians: float
    gaussians_ms: float


@dataclass(frozen=True)
class OfPrice:
    """What a price leaves: of what is priced, and of the error."""

    price: float
    left: float  # the share of the norm that is far, or of the numbers that act
    lesson: float  # mm, rms at rest, in what was learned from
    test: float  # mm, mean distance


def by_size(
    school: School, shapes: Shapes, test: Lesson, sizes: Sequence[int], report: Report
) -> list[OfSize]:
    """The first problem of scattered data: what examples cost."""
    linear, rows = without_pose_blend_shapes(school.body), []
    for n in sizes:
        report(f"  {n} examples")
        shares, gaussians = (
            measured(Contender("", taught(linear, kernel, directions), 0), test)
            for kernel, directions in (school.shares(n, shapes), school.gaussians(n, shapes))
        )
        rows.append(
            OfSize(n, shares.mean, shares.milliseconds, gaussians.mean, gaussians.milliseconds)
        )
    return rows


def by_reach(school: School, shapes: Shapes, examples: int) -> dict[str, Array]:
    """The second: what is predicted beyond the examples.

    Root mean square length of the blend shapes, mm, where poses of the trial are multiplied by
    FACTORS, by predictor.
    """
    taught_by = {n: (f, school.fit(f, shapes)[0]) for n, f in LINEAR_IN.items()}
    predictors: dict[str, tuple[Features, Array]] = {
        **taught_by,
        "LBS + shares of examples": school.shares(examples, shapes),
        "LBS + exact RBF of examples": school.gaussians(examples, shapes),
    }
    poses, found = school.trial.poses[:STRETCHED], {}
    for name, (features, directions) in predictors.items():
        nothing = np.zeros((len(poses), *directions.shape[:2]))
        found[name] = np.array([
            1e3 * left_over(feature_matrix(school.body, features, f * poses), nothing, directions)
            for f in FACTORS
        ])  # fmt: skip
    return found


def by_turn(school: School, shapes: Shapes, joint: str) -> dict[str, Array]:
    """A joint turned about the vertical, twice round: rms length of the shapes, mm, by TURNS."""
    poses = np.tile(school.body.bind_pose, (len(TURNS), 1, 1))
    poses[:, school.body.joint_names.index(joint), 1] = TURNS
    found = {}
    for name, features in LINEAR_IN.items():
        directions, _ = school.fit(features, shapes)
        A = feature_matrix(school.body, features, poses)
        flat = A @ directions.reshape(-1, directions.shape[2]).T
        found[name] = 1e3 * np.linalg.norm(flat, axis=1) / np.sqrt(len(directions))
    return found


def by_distance(school: School, shapes: Shapes, test: Lesson, report: Report) -> list[OfPrice]:
    """MANO's price on distance: how far blend shapes reach, and what keeping them near costs."""
    A, distances = school.features(rotation_elements)[0], joint_distances(school.body)
    rows = []
    for price in DISTANCE_PRICES:
        report(f"  price {price:g} per square metre")
        directions = local_ridge_at(A, shapes.lesson, distances, price, LEAST_PRICE)
        far = far_share(directions, distances)
        error = _tested(school, test, rotation_elements, directions)
        rows.append(OfPrice(price, far, 1e3 * left_over(A, shapes.lesson, directions), error))
    return rows


def by_sparsity(school: School, shapes: Shapes, test: Lesson, report: Report) -> list[OfPrice]:
    """STAR's features, fewer and fewer of them: how many numbers act, and what the rest was for."""
    A = school.features(quaternion_elements)[0]
    rows = []
    for price in GROUP_PRICES:
        report(f"  price {1e3 * price:g} mm of a joint at a vertex")
        chosen = group_lasso(A, shapes.lesson, 4, price)
        directions = refitted(A, shapes.lesson, chosen, 4)
        acting = acting_share(directions)
        error = _tested(school, test, quaternion_elements, directions)
        rows.append(OfPrice(price, acting, 1e3 * left_over(A, shapes.lesson, directions), error))
    return rows


def _tested(school: School, test: Lesson, features: Features, directions: Array) -> float:
    student = taught(without_pose_blend_shapes(school.body), features, directions)
    return measured(Contender("", student, 0), test).mean
