"""Pose blend shapes by ridge regression of what linear blend skinning gets wrong."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from workbench.training.embedded.skeleton import (
    PARENTS,
    binding_motions,
    blended,
    pose_features,
    skin,
    unskin,
)
from workbench.training.embedded.teacher import Teacher
from workbench.training.mirror import Mirror
from workbench.training.noticing import ByPattern, Mask, noticed

Array = NDArray[np.float64]
Report = Callable[[str], None]
Pair = tuple[Array, Array]  # of n poses: features (n, F), and un-posed errors (n, N, 3) m

RIDGES = (1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 2e-2, 3e-2, 1e-1)  # per pose
TOLERATED = 0.01  # of the energy: what a stronger ridge may leave more than the best one
LARGEST_ANGLE = np.radians(150)  # blending two rotations 180 degrees apart has no inverse


class Poses(Protocol):
    """What can draw `n` poses (n, 24, 3) rad."""

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """The pelvis unturned."""


def draw_poses(prior: Poses, n: int, rng: np.random.Generator) -> Array:
    """`n` poses (n, 24, 3) rad of the prior, those with a joint turned too far left out."""
    poses = prior.draw(2 * n, rng)
    possible = (np.linalg.norm(poses, axis=2) < LARGEST_ANGLE).all(axis=1)
    drawn: Array = poses[possible][:n]
    return drawn


@dataclass(frozen=True, eq=False)
class Lesson:
    """Sums over poses of features and un-posed errors: all that least squares needs."""

    features: Array  # (F, F): sum of f f^T
    products: Array  # (N, 3, F): sum of error f^T
    energy: float  # sum of squared errors, m^2
    n_poses: int

    @staticmethod
    def of(seen: Iterable[Pair]) -> "Lesson":
        """The sums over pairs, some poses at a time."""
        each = (
            Lesson(f.T @ f, np.tensordot(e, f, (0, 0)), float(np.vdot(e, e)), len(f))
            for f, e in seen
        )
        return reduce(add, each)

    def __add__(self, other: "Lesson") -> "Lesson":
        return Lesson(
            self.features + other.features,
            self.products + other.products,
            self.energy + other.energy,
            self.n_poses + other.n_poses,
        )

    def error(self, posedirs: Array) -> float:
        """The share of the energy that posedirs (N, 3, F) leave."""
        explained = 2 * self.products - posedirs @ self.features
        return float(1 - np.vdot(posedirs, explained) / self.energy)

    def with_reflections(self, mirror: Mirror | None) -> "Lesson":
        """As if every pose had also been seen in a mirror; the same without one."""
        if mirror is None:
            return self
        turned = self.features[np.ix_(mirror.features, mirror.features)]
        turned *= np.outer(mirror.feature_signs, mirror.feature_signs)
        products = self.products + mirror.posedirs(self.products)
        return Lesson(self.features + turned, products, 2 * self.energy, 2 * self.n_poses)


def unposed_error(teacher: Teacher, weights: Array, pose: Array) -> Array:
    """What must be added to the rest surface, (N, 3) m, for skinning to give the teacher's."""
    M, m = blended(weights, *binding_motions(pose, teacher.joints))
    return unskin(teacher.vertices(pose), M, m) - teacher.rest


def observe(teacher: Teacher, weights: Array, poses: Array, report: Report) -> Iterator[Pair]:
    """What a lesson is of, from `poses` (P, 24, 3) rad, a hundred at a time."""
    for start in range(0, len(poses), 100):
        chunk = poses[start : start + 100]
        yield pose_features(chunk), np.stack([unposed_error(teacher, weights, p) for p in chunk])
        if start % 500 == 0:
            report(f"  {start} of {len(poses)} poses")


def supports(weights: Array) -> Mask:
    """What a vertex notices, (N, F): features of the joints that carry it and their neighbours.

    On the default body these are 3.5 joints per vertex, and on held-out draws 94.1 % is explained;
    93.1 % without the neighbours, 94.1 % with their neighbours or with all joints.
    """
    return noticed(weights, PARENTS, 1)


def solve_ridge(lesson: Lesson, support: Mask, ridge: float) -> Array:
    """Posedirs (N, 3, F) m: least squares on each vertex's own features (N, F), else zero."""
    gram = lesson.features + ridge * lesson.n_poses * np.eye(len(lesson.features))
    return ByPattern.of(gram, support).solved(lesson.products)


def ridge_learned(
    learned: Lesson, held_back: Lesson, support: Mask, ridges: Sequence[float]
) -> tuple[Array, float]:
    """Posedirs (N, 3, F) m of both lessons, and the ridge: what leaves least of that held back."""
    ridge = min(ridges, key=lambda r: held_back.error(solve_ridge(learned, support, r)))
    return solve_ridge(learned + held_back, support, ridge), ridge


@dataclass(frozen=True)
class Correction:
    """Distances (mm) to the teacher's posed surface, and the share of squares explained."""

    poses: int
    rms_before: float
    rms_after: float
    mean_before: float
    mean_after: float

    @property
    def explained(self) -> float:
        """The share of the squared distance that the blend shapes take away."""
        return 1 - (self.rms_after / self.rms_before) ** 2


def measure(teacher: Teacher, weights: Array, posedirs: Array, poses: Array) -> Correction:
    """How far linear blend skinning is from the teacher, without and with the blend shapes."""
    sums = np.zeros(4)
    for pose, feature in zip(poses, pose_features(poses), strict=True):
        M, m = blended(weights, *binding_motions(pose, teacher.joints))
        goal = teacher.vertices(pose)
        for i, rest in enumerate((teacher.rest, teacher.rest + posedirs @ feature)):
            away = 1e3 * np.linalg.norm(skin(rest, M, m) - goal, axis=1)
            sums[[i, 2 + i]] += (away**2).mean(), away.mean()
    squares, means = np.split(sums / len(poses), 2)
    before, after = np.sqrt(squares)
    return Correction(len(poses), *map(float, (before, after, *means)))


def learn_pose_blends(
    teacher: Teacher, weights: Array, mirror: Mirror, poses: tuple[Array, Array], report: Report
) -> tuple[Array, float]:
    """Posedirs (N, 3, 207) m from the first set of poses, and the ridge, chosen on the second.

    It is the strongest one that leaves hardly more than the best: small blend shapes do less harm
    in poses that were not drawn.
    """
    seen = (observe(teacher, weights, some, report) for some in poses)
    lesson, test = (Lesson.of(pairs).with_reflections(mirror) for pairs in seen)
    support = supports(weights)
    tried = {ridge: test.error(solve_ridge(lesson, support, ridge)) for ridge in RIDGES}
    ridge = max(r for r in RIDGES if tried[r] <= min(tried.values()) + TOLERATED)
    posedirs = solve_ridge(lesson, support, ridge)
    report(f"  ridge {ridge:g}: {1 - tried[ridge]:.1%} explained on held-out draws")
    return (posedirs + mirror.posedirs(posedirs)) / 2, ridge
