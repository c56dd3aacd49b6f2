"""Differences between the edges of two meshes, which do not depend on where they stand."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Points
from workbench.residuals.arguments import (
    confidences,
    expressed,
    given,
    named_after,
    numbered,
    same_shape,
)
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import Residual


def edges(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    pairs: ArrayLike,
    *,
    sigma: float,
    confidence: cs.MX | ArrayLike | None = None,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """(v_a - v_b) - (v^_a - v^_b) in metres for pairs (E, 2) of vertices: the E_C of edges.

    A translation of either changes nothing, so shape can be compared before it is known where
    the body stands (SMPL, section 4.1: the pose of a registration). `observed` is the symbol of
    a block (N, 3), or an array. The confidence of a pair (E,), from 0 on, is the weight of its
    three rows, outside of the kernel: 1/2 w rho((r / sigma)^2). `kernel=of_norms(...)` takes
    the length of the difference of two edges instead of each coordinate.
    Raises BadResidual for pairs of vertices that do not exist and for confidences below zero.
    """
    predicted, reads = expressed(points)
    name = name or named_after("edges", observed, points)
    target = given(name, "what was observed", observed, predicted.shape[::-1])
    same_shape(name, predicted, target)
    N = predicted.shape[1]
    found = numbered(name, "pairs (E", pairs, 2, N)
    E = len(found)
    rows, entries = np.repeat(np.arange(E), 2).tolist(), np.tile([1.0, -1.0], E)
    ends = cs.DM.triplet(rows, found.ravel().tolist(), cs.DM(entries), E, N)
    difference = (predicted - target) @ ends.T  # (3, E) m
    weights = None if confidence is None else confidences(name, confidence, E, "pairs")
    return Residual(
        name, cs.vec(difference), sigma, "m", kernel, reads, weights=weights, rows_per_point=3
    )
