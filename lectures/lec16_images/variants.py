"""Exercises of lecture 16 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "torso_depth",
    points=2,
    minutes=15,
    draw=lambda rng: {
        "PAIRS": [sorted(int(k) for k in pair) for pair in rng.permutation(8)[:6].reshape(3, 2)],
        "FOCAL": rounded(rng, 700, 1900, digits=1),
    },
    arguments=lambda rng, numbers: (rng.uniform(-1, 1, (8, 3)), rng.uniform(0, 900, (8, 2))),
)
def torso_depth(points: Array, pixels: Array, *, PAIRS: list[list[int]], FOCAL: float) -> float:
    """How far away a person is, by similar triangles on bones that the camera sees well.

    The bones lead from row PAIRS[k][0] to row PAIRS[k][1]. The length that counts is the mean of theirs, in
    space and in the image alike. The focal length is FOCAL px.

    points (8, 3) m; pixels (8, 2) px -> m
    """
    a, b = np.array(PAIRS).T
    in_space, in_image = (
        np.linalg.norm(places[a] - places[b], axis=1).mean() for places in (points, pixels)
    )
    return FOCAL * in_space / in_image


@mistake("torso_depth", "this is the mean of ratios; it has to be the ratio of means")
def torso_depth_of_ratios(points, pixels, *, PAIRS, FOCAL):
    a, b = np.array(PAIRS).T
    in_space, in_image = (np.linalg.norm(p[a] - p[b], axis=1) for p in (points, pixels))
    return FOCAL * np.mean(in_space / in_image)


@variant(
    "sphere_slope",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "FACTOR": rounded(rng, 0.21, 0.9, digits=3),
        "WEIGHT": rounded(rng, 1.1, 9.9, digits=2),
    },
    arguments=lambda rng, numbers: (rng.uniform(0.02, 0.2), *rng.uniform(0.05, 0.2, 2)),
)
def sphere_slope(distance: float, r1: float, r2: float, *, FACTOR: float, WEIGHT: float) -> float:
    """The derivative of a term of two spheres by the distance of their centres.

    The term is WEIGHT exp(-distance^2 / (s1^2 + s2^2)) with s = FACTOR r for each sphere.

    distance, r1, r2 m -> 1/m
    """
    width = FACTOR**2 * (r1**2 + r2**2)
    return -2 * WEIGHT * distance / width * np.exp(-(distance**2) / width)


@mistake("sphere_slope", "the factor is squared with the radius")
def sphere_slope_without_square(distance, r1, r2, *, FACTOR, WEIGHT):
    return sphere_slope.solution(distance, r1, r2, FACTOR=np.sqrt(FACTOR), WEIGHT=WEIGHT)
