"""Registration: surfaces and points brought onto scans, without known correspondences."""

from workbench.registration.coupling import Coupling, by_edges, by_vertices
from workbench.registration.free_vertices import (
    QUICK_STAGES,
    STAGES,
    FreeVertices,
    Registered,
    Stage,
    StageResult,
    posterior_sd,
)
from workbench.registration.scan_term import ScanTerm, touched

__all__ = [
    "QUICK_STAGES",
    "STAGES",
    "Coupling",
    "FreeVertices",
    "Registered",
    "ScanTerm",
    "Stage",
    "StageResult",
    "by_edges",
    "by_vertices",
    "posterior_sd",
    "touched",
]
