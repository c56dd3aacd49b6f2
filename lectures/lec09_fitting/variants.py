"""Exercises of lecture 9 with numbers of each student's own, for packs."""

import numpy as np

from workbench.course.packs import mistake, rounded, variant

Array = np.ndarray


@variant(
    "project",
    points=3,
    minutes=20,
    draw=lambda rng: {
        "FOCAL": rounded(rng, 700, 1900, digits=1),
        "AT": [
            rounded(rng, -1.5, 1.5, digits=3),
            rounded(rng, 0.9, 1.9, digits=3),
            rounded(rng, 3.1, 5.9, digits=3),
        ],
        "YAW": rounded(rng, -0.35, 0.35, digits=3),
        "CENTRE": [640.0, 360.0],
    },
    arguments=lambda rng, numbers: (rng.uniform(-0.8, 0.8, (4, 3)),),
)
def project(
    points: Array, *, FOCAL: float, AT: list[float], YAW: float, CENTRE: list[float]
) -> Array:
    """Where your camera sees points of the world.

    It stands at AT m. With YAW = 0 it looks along -z of the world, with x to the right and y up; it is then
    turned by YAW rad about the vertical y (positive: from z towards x). In the image u goes to the right and
    v goes down; a point in the middle of the view is at CENTRE px. The focal length is FOCAL px.

    points (n, 3) m, all in front of the camera -> (n, 2) px
    """
    c, s = np.cos(YAW), np.sin(YAW)
    right, back = np.array([c, 0, -s]), np.array([s, 0, c])
    off = points - AT
    away = -off @ back
    return np.column_stack([off @ right, -off[:, 1]]) * FOCAL / away[:, None] + CENTRE


@mistake("project", "the camera turns the other way: points turn against it")
def project_with_the_other_turn(points, *, FOCAL, AT, YAW, CENTRE):
    return project.solution(points, FOCAL=FOCAL, AT=AT, YAW=-YAW, CENTRE=CENTRE)


@mistake("project", "v goes down in the image, and y goes up in the world")
def project_upside_down(points, *, FOCAL, AT, YAW, CENTRE):
    right_way = project.solution(points, FOCAL=FOCAL, AT=AT, YAW=YAW, CENTRE=CENTRE)
    return np.column_stack([right_way[:, 0], 2 * CENTRE[1] - right_way[:, 1]])


@variant(
    "keypoint_residual",
    points=2,
    minutes=12,
    draw=lambda rng: {
        "SIGMAS": rounded(rng, 2.1, 9.9, count=5, digits=2),
        "FLOOR": rounded(rng, 0.11, 0.4, digits=2),
    },
    arguments=lambda rng, numbers: (
        *rng.uniform(0, 900, (2, 5, 2)),
        np.r_[rng.uniform(0, 1, 4), 0.05],
    ),
)
def keypoint_residual(
    seen: Array, observed: Array, confidence: Array, *, SIGMAS: list[float], FLOOR: float
) -> Array:
    """The residual of five keypoints in standard deviations, model minus observation.

    Point i has the standard deviation SIGMAS[i] / c px at the confidence c; below the confidence FLOOR a
    detector is guessing, and both entries of the point are zero.

    seen (5, 2) px, where the model puts the points; observed (5, 2) px; confidence (5,) -> (10,)
    """
    trusted = np.where(confidence < FLOOR, 0.0, confidence)
    return ((trusted / SIGMAS)[:, None] * (seen - observed)).ravel()


@mistake("keypoint_residual", "what is below FLOOR does not count at all")
def keypoint_residual_without_floor(seen, observed, confidence, *, SIGMAS, FLOOR):
    return keypoint_residual.solution(seen, observed, confidence, SIGMAS=SIGMAS, FLOOR=0.0)


@variant(
    "place",
    points=3,
    minutes=25,
    draw=lambda rng: {"WEIGHTS": rounded(rng, 0.21, 4.9, count=6, digits=3)},
    arguments=lambda rng, numbers: (*rng.standard_normal((2, 6, 3)),),
)
def place(rest: Array, seen: Array, *, WEIGHTS: list[float]) -> tuple[Array, Array]:
    """The rigid motion x -> R x + t that brings points nearest to where they were seen.

    It minimises the sum of WEIGHTS[i] |R x_i + t - y_i|^2, and R is a rotation, not a reflection.

    rest (6, 3) m; seen (6, 3) m -> (R (3, 3), t (3,) m)
    """
    w = np.array(WEIGHTS) / np.sum(WEIGHTS)
    p, q = w @ rest, w @ seen
    U, _, Vt = np.linalg.svd((w[:, None] * (seen - q)).T @ (rest - p))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, q - R @ p


@mistake("place", "the means have weights, too")
def place_about_plain_means(rest, seen, *, WEIGHTS):
    p, q = rest.mean(axis=0), seen.mean(axis=0)
    U, _, Vt = np.linalg.svd((np.array(WEIGHTS)[:, None] * (seen - q)).T @ (rest - p))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, q - R @ p
