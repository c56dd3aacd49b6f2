"""Residuals: short functions from points and numbers to named columns that should be zero."""

from workbench.residuals.contacts import Form, distance, loose, offset, plane
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms, quadratic, scaled
from workbench.residuals.numbers import (
    HINGES,
    Hinge,
    bending,
    gaussian,
    limits,
    max_mixture,
)
from workbench.residuals.points import (
    edges,
    keypoints,
    landmarks,
    mirrored,
    regressed,
    stitching,
    vertices,
)
from workbench.residuals.residual import Residual
from workbench.residuals.scans import free_space, scan_to_model
from workbench.residuals.self_contact import apart, gaps, spheres
from workbench.residuals.sequences import smooth

__all__ = [
    "HINGES",
    "Form",
    "Hinge",
    "Kernel",
    "Residual",
    "apart",
    "bending",
    "distance",
    "edges",
    "free_space",
    "gaps",
    "gaussian",
    "geman_mcclure",
    "huber",
    "keypoints",
    "landmarks",
    "limits",
    "loose",
    "max_mixture",
    "mirrored",
    "of_norms",
    "offset",
    "plane",
    "quadratic",
    "regressed",
    "scaled",
    "scan_to_model",
    "smooth",
    "spheres",
    "stitching",
    "vertices",
]
