"""Soft tissue from meshes in motion: dynamic blend shapes, and a stable model that drives them."""

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
