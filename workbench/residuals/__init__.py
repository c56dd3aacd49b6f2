"""Residuals: short functions from points and numbers to named columns that should be zero."""

from workbench.residuals.edges import edges
from workbench.residuals.gaussian import gaussian
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms, quadratic
from workbench.residuals.keypoints import keypoints
from workbench.residuals.mirrored import mirrored
from workbench.residuals.points import landmarks, vertices
from workbench.residuals.regressed import regressed
from workbench.residuals.residual import Residual
from workbench.residuals.smooth import smooth
from workbench.residuals.stitching import stitching

__all__ = [
    "Kernel",
    "Residual",
    "edges",
    "gaussian",
    "geman_mcclure",
    "huber",
    "keypoints",
    "landmarks",
    "mirrored",
    "of_norms",
    "quadratic",
    "regressed",
    "smooth",
    "stitching",
    "vertices",
]
