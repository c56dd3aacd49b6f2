"""Differences between points that are projected into an image and observed keypoints."""

import casadi as cs
from numpy.typing import ArrayLike

from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.geometry.camera import Camera
from workbench.residuals.arguments import (
    confidences,
    expressed,
    given,
    named_after,
    row_labels,
    same_shape,
)
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def keypoints(
    points: Points | cs.MX,
    camera: Camera,
    observed: cs.MX | ArrayLike,
    confidence: cs.MX | ArrayLike,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """Pi(p_k(theta, beta)) - u^_k in pixels, for one camera; E_J of SMPLify (Bogo et al. 2016):

        1/2 sum over k of w_k (rho(du_k^2 / sigma^2) + rho(dv_k^2 / sigma^2))

    with the confidence of keypoint k as its weight w_k. SMPLify's code has rho of each coordinate;
    its paper writes rho of the difference of two points, which is 1/2 sum over k of w_k rho((du_k^2
    + dv_k^2) / sigma^2) and is chosen with kernel=of_norms(geman_mcclure). The weight stands
    outside of the kernel, as in SMPLify: sigma alone determines what counts as an outlier, and a
    doubtful keypoint has less influence both near and far. Without a robust kernel a keypoint of
    weight w has the standard deviation sigma / sqrt(w) px; for a standard deviation of sigma / c
    give confidence=c**2, as SPIN does (Kolotouros et al. 2019).

    points (3, M) m; observed (M, 2) px and confidence (M,), from 0 on, are symbols of blocks, or
    arrays, or expressions of symbols. A keypoint of confidence 0 has no influence, and its
    coordinates do not matter as long as they are numbers. Raises BadResidual for shapes that do not
    fit and for confidences below zero.

    A pinhole also projects what is behind it, upside down, but a camera sees nothing there. The
    depths (M,) m in front of the camera are therefore the domain of the residual: a posterior has
    no density where a keypoint with a confidence above 0 is behind the camera. (At a depth of 0 the
    residual is no number.) The residual itself, and with it fits, are those of the pinhole.
    """
    predicted, reads = expressed(points)
    if not isinstance(camera, Camera):
        raise BadResidual(
            f"keypoints are seen by a Camera, not by something of type {type(camera).__name__}"
        )
    seen = camera.seen(predicted)  # (3, M) m
    pixels = camera.image_of(seen)  # (2, M) px
    name = name or named_after("keypoints", observed, points)
    M = pixels.shape[1]
    target = given(name, "what was observed", observed, (M, 2))
    same_shape(name, pixels, target)
    weights = confidences(name, confidence, M, "keypoints")
    off = cs.vec(pixels - target)  # (2 M, 1) px
    labels = row_labels(points, "uv")
    known = reads, labels, weights, camera.blocks, 2
    return Residual(name, off, sigma, "px", kernel, *known, domain=seen[2, :].T)
