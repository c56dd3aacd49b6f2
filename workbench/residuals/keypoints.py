"""Points seen in an image."""

import casadi as cs
from numpy.typing import ArrayLike

from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.geometry.camera import Camera
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import (
    Residual,
    expressed,
    given,
    named_after,
    row_labels,
    same_shape,
)


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
    """c_k (Pi(p_k(theta, beta)) - u^_k) in pixels, for one camera: E_J of SMPLify.

    points (3, M) m; observed (M, 2) px and confidence (M,) in [0, 1] are symbols of blocks, or
    arrays. A keypoint of confidence c is ordinary at sigma / c pixels; at 0 it has no say, and its
    coordinates do not matter as long as they are numbers.
    """
    predicted, reads = expressed(points)
    pixels = camera.project(predicted)  # (2, M) px
    name = name or named_after("keypoints", observed, points)
    M = pixels.shape[1]
    target = given(name, "what was observed", observed, (M, 2))
    same_shape(name, pixels, target)
    sure = given(name, "the confidence", confidence, (M,))
    if sure.shape != (M, 1):
        raise BadResidual(
            f"residual {name!r} has {M} keypoints, but confidences of shape "
            f"{sure.shape}; give one for each"
        )
    off = cs.vec((pixels - target) * cs.repmat(sure.T, 2, 1))  # (2 M, 1) px
    return Residual(name, off, sigma, "px", kernel, reads, row_labels(points, "uv"))
