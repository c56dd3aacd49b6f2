"""A symbolic workbench for parametric body models: build, fit, diagnose.

`values -> blocks -> symbolic points -> residuals -> problem -> solver, diagnosis -> report`
"""

from workbench import residuals
from workbench.blocks import Block, Layout, Points, Values
from workbench.bodies import Landmarks, SkinnedBody, linear_blend
from workbench.bodies.catalogue import load_body
from workbench.bodies.saving import save_body
from workbench.diagnostics import Diagnosis, diagnose
from workbench.errors import WorkbenchError
from workbench.geometry.camera import Camera
from workbench.problem import Linearization, Problem
from workbench.residuals import Residual
from workbench.solvers import (
    SOLVERS,
    GaussNewton,
    Ipopt,
    LevenbergMarquardt,
    Nlopt,
    Solution,
    Status,
    solve,
)
from workbench.training.training import train

__all__ = [
    "SOLVERS",
    "Block",
    "Camera",
    "Diagnosis",
    "GaussNewton",
    "Ipopt",
    "Landmarks",
    "Layout",
    "LevenbergMarquardt",
    "Linearization",
    "Nlopt",
    "Points",
    "Problem",
    "Residual",
    "SkinnedBody",
    "Solution",
    "Status",
    "Values",
    "WorkbenchError",
    "diagnose",
    "linear_blend",
    "load_body",
    "residuals",
    "save_body",
    "solve",
    "train",
]
