"""Residuals: short functions from points and numbers to named columns that should be zero."""

from workbench.residuals.bending import HINGES, Hinge, bending
from workbench.residuals.contact_forms import Form, distance, loose, offset, plane
from workbench.residuals.edges import edges
from workbench.residuals.free_space import free_space
from workbench.residuals.gaussian import gaussian
from workbench.residuals.kernels import Kernel, geman_mcclure, huber, of_norms, quadratic, scaled
from workbench.residuals.keypoints import keypoints
from workbench.residuals.limits import limits
from workbench.residuals.mirrored import mirrored
from workbench.residuals.mixture import log_sum_mixture, max_mixture
from workbench.residuals.on_plane import on_plane
from workbench.residuals.points import landmarks, vertices
from workbench.residuals.regressed import regressed
from workbench.residuals.residual import Residual
from workbench.residuals.scans import model_to_scan, scan_to_model
from workbench.residuals.self_contact import apart, gaps, spheres
from workbench.residuals.smooth import smooth
from workbench.residuals.stitching import stitching
from workbench.residuals.student import student_t

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
    "log_sum_mixture",
    "loose",
    "max_mixture",
    "mirrored",
    "model_to_scan",
    "of_norms",
    "offset",
    "on_plane",
    "plane",
    "quadratic",
    "regressed",
    "scaled",
    "scan_to_model",
    "smooth",
    "spheres",
    "stitching",
    "student_t",
    "vertices",
]
