"""A symbolic workbench for parametric body models: build, fit, diagnose, sample.

`values -> blocks -> symbolic points -> residuals -> problem -> solver, diagnosis -> report`
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from workbench import residuals
from workbench.blocks import Block, Layout, Points, Values
from workbench.bodies import Landmarks, SkinnedBody, dual_quaternion_blend, linear_blend
from workbench.bodies.catalogue import load_body
from workbench.bodies.saving import save_body
from workbench.bodies.triangles import TriangleBody
from workbench.comparison import Budget, Comparison, compare
from workbench.diagnostics import Diagnosis, diagnose
from workbench.errors import WorkbenchError
from workbench.geometry.camera import Camera
from workbench.problem import Constraint, Linearization, Problem
from workbench.residuals import Residual
from workbench.solvers import (
    SOLVERS,
    Dogleg,
    GaussNewton,
    Ipopt,
    LevenbergMarquardt,
    Newton,
    Nlopt,
    Scipy,
    Solution,
    Sqp,
    Staged,
    Status,
    SteepestDescent,
    solve,
)
from workbench.training.training import train

if TYPE_CHECKING:
    from workbench import sampling as sampling
    from workbench.sampling import Posterior, laplace, sample

__all__ = [
    "SOLVERS",
    "Block",
    "Budget",
    "Camera",
    "Comparison",
    "Constraint",
    "Diagnosis",
    "Dogleg",
    "GaussNewton",
    "Ipopt",
    "Landmarks",
    "Layout",
    "LevenbergMarquardt",
    "Linearization",
    "Newton",
    "Nlopt",
    "Points",
    "Posterior",
    "Problem",
    "Residual",
    "Scipy",
    "SkinnedBody",
    "Solution",
    "Sqp",
    "Staged",
    "Status",
    "SteepestDescent",
    "TriangleBody",
    "Values",
    "WorkbenchError",
    "compare",
    "diagnose",
    "dual_quaternion_blend",
    "laplace",
    "linear_blend",
    "load_body",
    "residuals",
    "sample",
    "save_body",
    "solve",
    "train",
]

SAMPLING = "Posterior", "laplace", "sample"


def __getattr__(name: str) -> Any:
    """What belongs to sampling is loaded when it is asked for: emcee takes a second, with SciPy."""
    if name not in (*SAMPLING, "sampling"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    room = import_module("workbench.sampling")
    return room if name == "sampling" else getattr(room, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *SAMPLING, "sampling"})
