"""Differences between points in space and observed ones: vertices, joints, landmarks."""

import casadi as cs
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Points
from workbench.residuals.arguments import expressed, given, named_after, row_labels, same_shape
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def vertices(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """v_i(theta, beta) - v^_i in metres: E_D of known correspondences.

    `observed` is the symbol of a block (N, 3), whose numbers may change, or an array (N, 3).
    `kernel=of_norms(...)` takes the distance |v_i - v^_i| instead of each coordinate.
    """
    name = name or named_after("vertices", observed, points)
    return landmarks(points, observed, sigma=sigma, kernel=kernel, name=name)


def landmarks(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """p_k(theta, beta) - p^_k in metres for named points (joints, keypoints).

    `observed` is the symbol of a block (M, 3), whose numbers may change, or an array (M, 3).
    `kernel=of_norms(...)` takes the distance |p_k - p^_k| instead of each coordinate.
    """
    predicted, reads = expressed(points)
    name = name or named_after("landmarks", observed, points)
    target = given(name, "what was observed", observed, predicted.shape[::-1])
    same_shape(name, predicted, target)
    difference = cs.vec(predicted - target)  # (3 N, 1) m
    labels = row_labels(points, "xyz")
    return Residual(name, difference, sigma, "m", kernel, reads, labels, rows_per_point=3)
