"""Exercises of lecture 9, fitting.

Write each answer in place of the line that raises. Names, arguments and shapes stay as they are.
Lengths are in metres, angles in radians, images in pixels; a camera's frame has x to the right, y
down and z forward. Then

    workbench lecture check 9 lec09_fitting.py
"""

import numpy as np

import workbench as wb
from workbench.course import Unsolved

Array = np.ndarray

BODY = "small"  # of the last exercise: wb.load_body(BODY)
NOISE, POSE, BETAS = 0.005, 0.25, 1.0  # m, rad, 1: the sigmas of the last exercise


def project(points: Array, R: Array, t: Array, f: float, c: Array) -> Array:
    """What a pinhole camera sees of points in the world. R and t take the world to its frame.

    points (n, 3) m; R (3, 3), t (3,) m; f px; c (2,) px, the image's centre -> (n, 2) px
    """
    raise Unsolved("project")


def depth(lengths: Array, pixels: Array, f: float) -> float:
    """How far away a body is, by similar triangles: f times the mean length over the mean of the pixels.

    lengths (n,) m, of some bones across the line of sight; pixels (n,) px, how long they appear;
    f px -> m
    """
    raise Unsolved("depth")


def keypoint_residual(seen: Array, observed: Array, confidence: Array, sigma: float) -> Array:
    """The residual of keypoints, in sigmas; a point of confidence c has the sigma sigma / c px.

    Model minus observation; u and v of the first point, u and v of the second, and so on.

    seen (n, 2) px, by the model; observed (n, 2) px; confidence (n,) from 0 to 1; sigma px -> (2 n,)
    """
    raise Unsolved("keypoint_residual")


def triangulate(cameras: list[Array], seen: list[Array]) -> Array:
    """Where a point is that two cameras or more have seen; there is no noise.

    cameras[i] (3, 4) is [R t], from the world to that camera's frame; seen[i] (2,) is where its
    image is at depth one: (X / Z, Y / Z), pixels less the centre over the focal length.

    -> (3,) m
    """
    raise Unsolved("triangulate")


def place(rest: Array, seen: Array) -> tuple[Array, Array]:
    """The rigid motion x -> R x + t that takes points nearest to where they were seen.

    Least in the sum of |R x_i + t - y_i|^2, and R is no reflection.

    rest (n, 3) m; seen (n, 3) m -> (R (3, 3), t (3,) m)
    """
    raise Unsolved("place")


def fit(seen: Array) -> tuple[Array, Array, Array]:
    """Pose, betas and translation of the body BODY, from where its 24 joints were seen.

    Least in |joints - seen|^2 / NOISE^2 + |pose|^2 / POSE^2 + |betas|^2 / BETAS^2. As in the
    lecture: blocks, residuals, a problem, `wb.solve`.

    seen (24, 3) m -> (pose (24, 3) rad, betas (10,), trans (3,) m)
    """
    wb.load_body(BODY)
    raise Unsolved("fit")
