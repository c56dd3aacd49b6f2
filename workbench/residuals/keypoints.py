"""Points seen in an image."""

import casadi as cs

from workbench.blocks import Points
from workbench.errors import BadResidual
from workbench.geometry.camera import Camera
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual, expressed, named, row_labels, same_shape


def keypoints(
    points: Points | cs.MX,
    camera: Camera,
    observed: cs.MX,
    confidence: cs.MX,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """c_k (Pi(p_k(theta, beta)) - u^_k) in pixels, for one camera: E_J of SMPLify.

    points (3, M) m, observed (2, M) px, confidence (M, 1) in [0, 1]. A keypoint of confidence c
    is ordinary at sigma / c pixels; at 0 it has no say, and its coordinates do not matter as
    long as they are numbers.
    """
    predicted, reads = expressed(points)
    pixels = camera.project(predicted)  # (2, M) px
    name = name or named("keypoints", observed)
    same_shape(name, pixels, observed)
    if confidence.shape != (observed.shape[1], 1):
        raise BadResidual(
            f"residual {name!r} has {observed.shape[1]} keypoints, but confidences of shape "
            f"{confidence.shape}; give one for each"
        )
    off = cs.vec((pixels - observed) * cs.repmat(confidence.T, 2, 1))  # (2 M, 1) px
    return Residual(name, off, sigma, "px", kernel, reads, row_labels(points, "uv"))
