"""Fitting bodies to observations: keypoints, joints and meshes, their files, and where to start.

A fit is described by a `Setup`: a problem, a start, and what is measured when it has been solved.

    >>> from workbench import load_body, solve
    >>> from workbench.fitting import mesh_fit
    >>> body = load_body("small")
    >>> setup = mesh_fit(body, body.vertices(trans=[0.1, 0, 0]), "Where is it?", sigma=0.001)
    >>> solve(setup.problem, setup.start).values["trans"].round(3).tolist()
    [0.1, 0.0, 0.0]
"""

from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.calibration_files import read_calibration
from workbench.fitting.clip_files import read_clip
from workbench.fitting.clips import Clip, Film, clip_of
from workbench.fitting.effective_frames import effective_frames
from workbench.fitting.keypoint_files import read_keypoints, read_observations
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.known import KnownAnswer
from workbench.fitting.landmarks import joint_fit
from workbench.fitting.mesh_start import STARTS, from_correspondences, placed
from workbench.fitting.meshes import mesh_fit, own_mesh
from workbench.fitting.observations import BadObservation, Observations, Photograph, photograph
from workbench.fitting.scan import BadScan, Scan
from workbench.fitting.scan_boundary import boundary
from workbench.fitting.scan_files import ReadScan, read_scan
from workbench.fitting.setup import Measure, Moving, Setup, View
from workbench.fitting.videos import Smoothness, video_fit

__all__ = [
    "STARTS",
    "BadObservation",
    "BadScan",
    "Clip",
    "Film",
    "KnownAnswer",
    "Measure",
    "Moving",
    "Observations",
    "Photograph",
    "ReadScan",
    "Scan",
    "Setup",
    "Smoothness",
    "View",
    "boundary",
    "clip_of",
    "effective_frames",
    "from_correspondences",
    "joint_fit",
    "keypoint_fit",
    "mesh_fit",
    "own_mesh",
    "photograph",
    "placed",
    "pose_prior",
    "read_calibration",
    "read_clip",
    "read_keypoints",
    "read_observations",
    "read_scan",
    "shape_prior",
    "video_fit",
]
