"""Registration: surfaces and points brought onto scans, without known correspondences."""

from workbench.registration.doubts import Doubts, doubts
from workbench.registration.model_fit import STAGES, ModelFit, Progress, Stage, fit_model
from workbench.registration.scan_starts import arms_lowered, scan_starts
from workbench.registration.support import Support, support

__all__ = [
    "STAGES",
    "Doubts",
    "ModelFit",
    "Progress",
    "Stage",
    "Support",
    "arms_lowered",
    "doubts",
    "fit_model",
    "scan_starts",
    "support",
]
