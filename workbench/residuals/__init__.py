"""Residuals: short functions from points and numbers to named columns that should be zero."""

from workbench.residuals.contact_forms import Form, distance, loose, offset, plane
from workbench.residuals.edges import edges
from workbench.residuals.gaussian import gaussian
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms, quadratic, scaled
from workbench.residuals.keypoints import keypoints
from workbench.residuals.mirrored import mirrored
from workbench.residuals.points import landmarks, vertices
from workbench.residuals.regressed import regressed
from workbench.residuals.residual import Residual
from workbench.residuals.scans import model_to_scan, scan_to_model
from workbench.residuals.self_contact import apart, gaps, spheres
from workbench.residuals.smooth import smooth
from workbench.residuals.stitching import stitching

__all__ = [
    "Form",
    "Kernel",
    "Residual",
    "apart",
    "distance",
    "edges",
    "gaps",
    "gaussian",
    "geman_mcclure",
    "huber",
    "keypoints",
    "landmarks",
    "loose",
    "mirrored",
    "model_to_scan",
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
