"""Fitting bodies to observations: keypoints, joints and meshes, their files, and where to start.

A fit is described by a `Setup`: a problem, a start, and what is measured when it has been solved.

    >>> from workbench import load_body, solve
    >>> from workbench.fitting import mesh_fit
    >>> body = load_body("small")
    >>> setup = mesh_fit(body, body.vertices(trans=[0.1, 0, 0]), "Where is it?", sigma=0.001)
    >>> solve(setup.problem, setup.start).values["trans"].round(3).tolist()
    [0.1, 0.0, 0.0]
"""

from workbench.fitting.body_priors import (
    pose_prior,
    shape_prior,
    tailed_pose_prior,
    usual_priors,
)
from workbench.fitting.calibration_files import read_calibration
from workbench.fitting.clip_files import read_clip
from workbench.fitting.clips import Clip, Film, clip_of
from workbench.fitting.detector_layouts import KEYPOINT_SCHEMAS
from workbench.fitting.effective_frames import effective_frames
from workbench.fitting.hand_fit import hand_fit, hand_landmarks, hand_problem, hand_start
from workbench.fitting.image_fit import ImageFits, image_fit
from workbench.fitting.image_recipe import (
    Appearance,
    ByHeight,
    ImageRecipe,
    WithStature,
    image_priors,
    smplify,
    tailed_priors,
    wider,
)
from workbench.fitting.keypoint_files import read_keypoints, read_observations
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.known import KnownAnswer
from workbench.fitting.landmarks import joint_fit
from workbench.fitting.loose_points import loose_points
from workbench.fitting.marker_files import MarkerRecording, read_markers
from workbench.fitting.marker_frames import random_frames, spread_frames
from workbench.fitting.marker_information import informative_frames
from workbench.fitting.marker_sets import MarkerSet, default_markers, read_marker_set
from workbench.fitting.markers import marker_fit, marker_solver
from workbench.fitting.measurement_candidates import (
    cameras_of,
    cameras_on_a_sphere,
    depth_of,
    keypoint_candidates,
    marker_candidates,
    pose_candidates,
    stature_of,
    without_hidden,
)
from workbench.fitting.mesh_start import STARTS, from_correspondences, placed
from workbench.fitting.meshes import mesh_fit, own_mesh
from workbench.fitting.mosh import MarkerFit, mosh
from workbench.fitting.observations import BadObservation, Observations, Photograph, photograph
from workbench.fitting.other_minima import OtherMinima, OtherMinimum, other_minima
from workbench.fitting.pose_regressor import PoseRegressor
from workbench.fitting.profile_likelihood import Profile, profile_likelihood
from workbench.fitting.regressed_start import regressed_start
from workbench.fitting.regressor_files import read_regressor, save_regressor, shipped_regressor
from workbench.fitting.regressor_training import train_pose_regressor
from workbench.fitting.repeated_fits import RepeatedFits, repeated_fits
from workbench.fitting.scan import BadScan, Scan
from workbench.fitting.scan_boundary import boundary
from workbench.fitting.scan_files import ReadScan, read_scan
from workbench.fitting.setup import Measure, Moving, Setup, View
from workbench.fitting.stature import stature, stature_prior
from workbench.fitting.video_mean import video_mean
from workbench.fitting.videos import Smoothness, video_fit

__all__ = [
    "KEYPOINT_SCHEMAS",
    "STARTS",
    "Appearance",
    "BadObservation",
    "BadScan",
    "ByHeight",
    "Clip",
    "Film",
    "ImageFits",
    "ImageRecipe",
    "KnownAnswer",
    "MarkerFit",
    "MarkerRecording",
    "MarkerSet",
    "Measure",
    "Moving",
    "Observations",
    "OtherMinima",
    "OtherMinimum",
    "Photograph",
    "PoseRegressor",
    "Profile",
    "ReadScan",
    "RepeatedFits",
    "Scan",
    "Setup",
    "Smoothness",
    "View",
    "WithStature",
    "boundary",
    "cameras_of",
    "cameras_on_a_sphere",
    "clip_of",
    "default_markers",
    "depth_of",
    "effective_frames",
    "from_correspondences",
    "hand_fit",
    "hand_landmarks",
    "hand_problem",
    "hand_start",
    "image_fit",
    "image_priors",
    "informative_frames",
    "joint_fit",
    "keypoint_candidates",
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
    "placed",
    "pose_candidates",
    "pose_prior",
    "profile_likelihood",
    "random_frames",
    "read_calibration",
    "read_clip",
    "read_keypoints",
    "read_marker_set",
    "read_markers",
    "read_observations",
    "read_regressor",
    "read_scan",
    "regressed_start",
    "repeated_fits",
    "save_regressor",
    "shape_prior",
    "shipped_regressor",
    "smplify",
    "spread_frames",
    "stature",
    "stature_of",
    "stature_prior",
    "tailed_pose_prior",
    "tailed_priors",
    "train_pose_regressor",
    "usual_priors",
    "video_fit",
    "video_mean",
    "wider",
    "without_hidden",
]
