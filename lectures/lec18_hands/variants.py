"""Exercises of lecture 18 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "pose_of",
    points=2,
    minutes=10,
    draw=lambda rng: {"LIMIT": rounded(rng, 0.61, 1.89, digits=3)},
    arguments=lambda rng, numbers: (
        rng.standard_normal((4, 3)),
        rng.standard_normal((3, 4, 3)),
        rng.uniform(0.1, 0.9, size=3),
        rng.choice([-1, 1], size=3) * rng.uniform([0.1, 2.0, 0.1], [0.5, 3.0, 3.0]),
    ),
)
def pose_of(mean: Array, components: Array, deviations: Array, z: Array, *, LIMIT: float) -> Array:
    """The pose of the fingers with coefficients z, none of which may be farther from 0 than LIMIT.

    z counts standard deviations of the components. A coefficient beyond LIMIT, on either side, is replaced
    by LIMIT with its sign. The pose is the mean pose, and each coefficient times the deviation of its
    component times the component.

    mean (J, 3) rad; components (C, J, 3) of length 1; deviations (C,) rad; z (C,) -> (J, 3) rad
    """
    return mean + np.tensordot(np.clip(z, -LIMIT, LIMIT) * deviations, components, axes=1)


@mistake("pose_of", "coefficients beyond LIMIT are replaced by LIMIT")
def pose_of_without_limits(mean, components, deviations, z, *, LIMIT):
    return mean + np.tensordot(z * deviations, components, axes=1)


@mistake("pose_of", "z counts standard deviations: LIMIT is compared with z, before the deviation")
def pose_of_radians(mean, components, deviations, z, *, LIMIT):
    return mean + np.tensordot(np.clip(z * deviations, -LIMIT, LIMIT), components, axes=1)


@mistake("pose_of", "a negative coefficient may not be below -LIMIT")
def pose_of_above(mean, components, deviations, z, *, LIMIT):
    return mean + np.tensordot(np.minimum(z, LIMIT) * deviations, components, axes=1)


@variant(
    "components_needed",
    points=2,
    minutes=12,
    draw=lambda rng: {"LEFT": rounded(rng, 0.31, 0.69, digits=3)},
    arguments=lambda rng, numbers: (
        np.sort(rng.uniform(0.02, 0.4, size=int(rng.integers(12, 40))))[::-1].copy(),
    ),
)
def components_needed(deviations: Array, *, LEFT: float) -> tuple[int, float]:
    """How many of the first components leave poses that are off by less than LEFT rad, rms.

    What is left of a pose is what the other components hold of it: the square root of the sum of their
    variances.

    deviations (C,) rad, in descending order
    -> the smallest number of components, and by how much what they leave is below LEFT, in rad
    """
    variance = np.cumsum((deviations**2)[::-1])[::-1]  # of the components from each one on
    left = np.sqrt(np.append(variance, 0.0))
    count = int(np.argmax(left < LEFT))
    return count, float(LEFT - left[count])


@mistake("components_needed", "variances are added, and not standard deviations")
def components_by_deviations(deviations, *, LEFT):
    left = np.append(np.cumsum(deviations[::-1])[::-1], 0.0)
    count = int(np.argmax(left < LEFT))
    return count, float(LEFT - left[count])


@mistake(
    "components_needed",
    "take the root of the variance that is left before comparing it with LEFT",
)
def components_by_variance(deviations, *, LEFT):
    left = np.append(np.cumsum((deviations**2)[::-1])[::-1], 0.0)
    count = int(np.argmax(left < LEFT))
    return count, float(LEFT - left[count])
