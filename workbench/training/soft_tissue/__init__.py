"""Soft tissue from meshes in motion: dynamic blend shapes, and a stable model that drives them.

Directions are principal components, parts are clusters of vertices that move alike, and the
matrices that predict the coefficients of the next frame are found by least squares. If a pole is
too large, all are scaled by one factor. `symbolic_form` says what the motions did not excite. There
is no open recording of tissue; `synthetic/tissue.py` simulates it with springs that stiffen.
"""

from workbench.training.soft_tissue.evaluating import TissueScore, score_tissue
from workbench.training.soft_tissue.identification import OneStep, TissueClip, stabilized
from workbench.training.soft_tissue.symbolic_form import one_step_problem, one_step_start
from workbench.training.soft_tissue.training import TissuePlan, train_tissue

__all__ = [
    "OneStep",
    "TissueClip",
    "TissuePlan",
    "TissueScore",
    "one_step_problem",
    "one_step_start",
    "score_tissue",
    "stabilized",
    "train_tissue",
]
