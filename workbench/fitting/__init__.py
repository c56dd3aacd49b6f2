"""Fitting bodies to observations: keypoints, joints and meshes, their files, and where to start.

A fit is described by a `Setup`: a problem, a start, and what is measured when it has been solved.
"""

from workbench.fitting.body_priors import (
    pose_prior,
    shape_prior,
    stature,
    usual_priors,
)
from workbench.fitting.candidates import (
    cameras_of,
    cameras_on_a_sphere,
    depth_of,
    marker_candidates,
    stature_of,
)
from workbench.fitting.files.cameras import read_calibration
from workbench.fitting.files.clips import read_clip
from workbench.fitting.files.keypoints import read_keypoints, read_observations
from workbench.fitting.files.layouts import KEYPOINT_SCHEMAS
from workbench.fitting.hands import hand_problem, hand_start
from workbench.fitting.images import (
    ByHeight,
    ImageFits,
    Smplify,
    WithStature,
    image_fit,
    image_priors,
)
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.known_points import (
    STARTS,
    from_correspondences,
    mesh_fit,
    own_mesh,
)
from workbench.fitting.marker_files import read_markers
from workbench.fitting.marker_sets import (
    MarkerSet,
    default_markers,
    read_marker_set,
)
from workbench.fitting.markers import marker_fit, marker_solver
from workbench.fitting.mosh import MarkerFit, mosh
from workbench.fitting.observations import (
    BadObservation,
    Clip,
    Film,
    Observations,
    photograph,
)
from workbench.fitting.placing import regressed_start
from workbench.fitting.pose_regressor import (
    PoseRegressor,
    read_regressor,
    shipped_regressor,
)
from workbench.fitting.refits import (
    OtherMinima,
    Profile,
    other_minima,
    profile_likelihood,
)
from workbench.fitting.scans.files import ReadScan, read_scan
from workbench.fitting.scans.scan import BadScan, Scan
from workbench.fitting.scans.surface import boundary, loose_points
from workbench.fitting.setup import KnownAnswer, Measure, Moving, Setup, View
from workbench.fitting.tracking import spread_frames
from workbench.fitting.videos import Smoothness, effective_frames, video_fit, video_mean

__all__ = [
    "KEYPOINT_SCHEMAS",
    "STARTS",
    "BadObservation",
    "BadScan",
    "ByHeight",
    "Clip",
    "Film",
    "ImageFits",
    "KnownAnswer",
    "MarkerFit",
    "MarkerSet",
    "Measure",
    "Moving",
    "Observations",
    "OtherMinima",
    "PoseRegressor",
    "Profile",
    "ReadScan",
    "Scan",
    "Setup",
    "Smoothness",
    "Smplify",
    "View",
    "WithStature",
    "boundary",
    "cameras_of",
    "cameras_on_a_sphere",
    "default_markers",
    "depth_of",
    "effective_frames",
    "from_correspondences",
    "hand_problem",
    "hand_start",
    "image_fit",
    "image_priors",
    "keypoint_fit",
    "loose_points",
    "marker_candidates",
    "marker_fit",
    "marker_solver",
    "mesh_fit",
    "mosh",
    "other_minima",
    "own_mesh",
    "photograph",
    "pose_prior",
    "profile_likelihood",
    "read_calibration",
    "read_clip",
    "read_keypoints",
    "read_marker_set",
    "read_markers",
    "read_observations",
    "read_regressor",
    "read_scan",
    "regressed_start",
    "shape_prior",
    "shipped_regressor",
    "spread_frames",
    "stature",
    "stature_of",
    "usual_priors",
    "video_fit",
    "video_mean",
]
