"""Exercises of lecture 9, fitting.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres, angles in radians, images in pixels. In the coordinates of a camera, x points to
the right, y down and z forward. This command grades the file:

    workbench lecture check 9 lec09_fitting.py
"""

import numpy as np

import workbench as wb
from workbench.course import Unsolved

Array = np.ndarray

BODY = "small"  # in the last exercise: wb.load_body(BODY)
NOISE, POSE, BETAS = 0.005, 0.25, 1.0  # m, rad, 1: the sigmas in the last exercise


def project(points: Array, R: Array, t: Array, f: float, c: Array) -> Array:
    """Where a pinhole camera sees points of the world; R x + t is a point x in its coordinates.

    points (n, 3) m; R (3, 3), t (3,) m; f px; c (2,) px, the image's centre -> (n, 2) px
    """
    raise Unsolved("project")


def depth(lengths: Array, pixels: Array, f: float) -> float:
    """The depth of a body by similar triangles: f times the mean length over the mean of the pixels.

    lengths (n,) m of some bones across the line of sight; pixels (n,) px, their lengths in the image; f
    px -> m
    """
    raise Unsolved("depth")


def keypoint_residual(seen: Array, observed: Array, confidence: Array, sigma: float) -> Array:
    """The residual of keypoints in standard deviations, which are sigma / c px at the confidence c.

    It is model minus observation: u and v of the first point, u and v of the second, and so on.

    seen (n, 2) px, where the model puts the points; observed (n, 2) px; confidence (n,) from 0 to 1;
    sigma px -> (2 n,)
    """
    raise Unsolved("keypoint_residual")


def triangulate(cameras: list[Array], seen: list[Array]) -> Array:
    """The position of a point that two or more cameras saw without noise.

    cameras[i] (3, 4) is [R t], from the world to the coordinates (X, Y, Z) of that camera; seen[i] (2,)
    is (X / Z, Y / Z), which is the pixel minus the image's centre, over the focal length.

    -> (3,) m
    """
    raise Unsolved("triangulate")


def place(rest: Array, seen: Array) -> tuple[Array, Array]:
    """The rigid motion x -> R x + t that brings points nearest to where they were seen.

    It minimises the sum of |R x_i + t - y_i|^2, and R is a rotation, not a reflection.

    rest (n, 3) m; seen (n, 3) m -> (R (3, 3), t (3,) m)
    """
    raise Unsolved("place")


def fit(seen: Array) -> tuple[Array, Array, Array]:
    """The pose, betas and translation of the body BODY, from its 24 joints as they were seen.

    They minimise |joints - seen|^2 / NOISE^2 + |pose|^2 / POSE^2 + |betas|^2 / BETAS^2. As in the
    lecture, make blocks, residuals and a problem, and call `wb.solve`.

    seen (24, 3) m -> (pose (24, 3) rad, betas (10,), trans (3,) m)
    """
    wb.load_body(BODY)
    raise Unsolved("fit")
