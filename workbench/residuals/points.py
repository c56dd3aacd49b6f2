"""Points in space against where they were seen: vertices, joints, landmarks."""

import casadi as cs

from workbench.blocks import Points
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual, expressed, named, row_labels, same_shape


def vertices(
    points: Points | cs.MX,
    observed: cs.MX,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """v_i(theta, beta) - v^_i, both (3, N), in metres: E_D of known correspondences."""
    return _difference("vertices", points, observed, sigma, kernel, name)


def landmarks(
    points: Points | cs.MX,
    observed: cs.MX,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """p_k(theta, beta) - p^_k for named points (joints, keypoints), both (3, M), in metres."""
    return _difference("landmarks", points, observed, sigma, kernel, name)


def _difference(
    function: str,
    points: Points | cs.MX,
    observed: cs.MX,
    sigma: float,
    kernel: Kernel,
    name: str | None,
) -> Residual:
    predicted, reads = expressed(points)
    name = name or named(function, observed)
    same_shape(name, predicted, observed)
    difference = cs.vec(predicted - observed)  # (3 N, 1) m
    return Residual(name, difference, sigma, "m", kernel, reads, row_labels(points, "xyz"))
