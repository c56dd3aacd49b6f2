"""Registration: surfaces and points brought onto scans, without known correspondences."""

from workbench.geometry.solids import random_surface_points
from workbench.registration.doubts import Support, doubts, support
from workbench.registration.free_vertices import (
    QUICK_VERTEX_STAGES,
    VERTEX_STAGES,
    FreeVertices,
    Registered,
    ScanTerm,
    VertexStage,
    by_edges,
    by_vertices,
    touched,
)
from workbench.registration.from_a_camera import seen_starts
from workbench.registration.icp import Alignment, Icp, IcpIterate, PointCloud, Stopped
from workbench.registration.icp_steps import (
    Contacts,
    GemanMcClure,
    LeastSquares,
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
)
from workbench.registration.model_fit import SEEN_STAGES, FitProgress, FitStage, ModelFit, fit_model
from workbench.registration.recipe import (
    HAND_RECIPE,
    PERSON_RECIPE,
    Recipe,
    usual_recipe,
    with_skeleton,
)
from workbench.registration.registering import (
    OtherEnd,
    Registration,
    StageOutcome,
    body_size,
    register,
)
from workbench.registration.scan_jobs import (
    FailedScan,
    Reading,
    RegisteredScan,
    ScanJob,
    jobs_of,
    registered,
)
from workbench.registration.starts import arms_lowered, facing, hand_starts, scan_starts

__all__ = [
    "HAND_RECIPE",
    "PERSON_RECIPE",
    "QUICK_VERTEX_STAGES",
    "SEEN_STAGES",
    "VERTEX_STAGES",
    "Alignment",
    "Contacts",
    "FailedScan",
    "FitProgress",
    "FitStage",
    "FreeVertices",
    "GemanMcClure",
    "Icp",
    "IcpIterate",
    "LeastSquares",
    "ModelFit",
    "OtherEnd",
    "PointCloud",
    "Reading",
    "Recipe",
    "Registered",
    "RegisteredScan",
    "Registration",
    "ScanJob",
    "ScanTerm",
    "StageOutcome",
    "Stopped",
    "Support",
    "VertexStage",
    "arms_lowered",
    "body_size",
    "by_edges",
    "by_vertices",
    "distance_gauss_newton",
    "doubts",
    "facing",
    "fit_model",
    "hand_starts",
    "jobs_of",
    "point_to_plane",
    "point_to_point",
    "random_surface_points",
    "register",
    "registered",
    "scan_starts",
    "seen_starts",
    "support",
    "touched",
    "usual_recipe",
    "with_skeleton",
]
