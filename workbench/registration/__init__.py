"""Registration: surfaces and points brought onto scans, without known correspondences."""

from workbench.registration.basins import BasinMap, basin_map
from workbench.registration.body_size import BodySize, body_size
from workbench.registration.coupling import Coupling, by_edges, by_vertices
from workbench.registration.doubts import Doubts, doubts
from workbench.registration.empty_space import EmptySpace
from workbench.registration.facing import facing
from workbench.registration.fit_stage import FitStage, Progress
from workbench.registration.free_vertices import (
    QUICK_VERTEX_STAGES,
    VERTEX_STAGES,
    FreeVertices,
    Registered,
    StageResult,
    VertexStage,
    posterior_sd,
)
from workbench.registration.hand_scan import fit_hand
from workbench.registration.hand_starts import hand_starts
from workbench.registration.icp import Alignment, Icp, IcpIterate, Stopped
from workbench.registration.icp_losses import GemanMcClure, LeastSquares, Trimmed
from workbench.registration.icp_steps import (
    Contacts,
    distance_gauss_newton,
    point_to_plane,
    point_to_point,
)
from workbench.registration.model_fit import FIT_STAGES, SEEN_STAGES, ModelFit, fit_model
from workbench.registration.point_cloud import PointCloud
from workbench.registration.recipe import (
    HAND_RECIPE,
    PERSON_RECIPE,
    Recipe,
    model_alone,
    usual_recipe,
)
from workbench.registration.registering import (
    OtherEnd,
    Registration,
    StageOutcome,
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
from workbench.registration.scan_starts import arms_lowered, scan_starts
from workbench.registration.scan_term import ScanTerm, touched
from workbench.registration.seen_starts import seen_starts
from workbench.registration.support import Support, support
from workbench.registration.surface_points import random_surface_points

__all__ = [
    "FIT_STAGES",
    "HAND_RECIPE",
    "PERSON_RECIPE",
    "QUICK_VERTEX_STAGES",
    "SEEN_STAGES",
    "VERTEX_STAGES",
    "Alignment",
    "BasinMap",
    "BodySize",
    "Contacts",
    "Coupling",
    "Doubts",
    "EmptySpace",
    "FailedScan",
    "FitStage",
    "FreeVertices",
    "GemanMcClure",
    "Icp",
    "IcpIterate",
    "LeastSquares",
    "ModelFit",
    "OtherEnd",
    "PointCloud",
    "Progress",
    "Reading",
    "Recipe",
    "Registered",
    "RegisteredScan",
    "Registration",
    "ScanJob",
    "ScanTerm",
    "StageOutcome",
    "StageResult",
    "Stopped",
    "Support",
    "Trimmed",
    "VertexStage",
    "arms_lowered",
    "basin_map",
    "body_size",
    "by_edges",
    "by_vertices",
    "distance_gauss_newton",
    "doubts",
    "facing",
    "fit_hand",
    "fit_model",
    "hand_starts",
    "jobs_of",
    "model_alone",
    "point_to_plane",
    "point_to_point",
    "posterior_sd",
    "random_surface_points",
    "register",
    "registered",
    "scan_starts",
    "seen_starts",
    "support",
    "touched",
    "usual_recipe",
]
