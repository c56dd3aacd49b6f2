"""A symbolic workbench for parametric body models: build, fit, diagnose, sample.

`values -> blocks -> symbolic points -> residuals -> problem -> solver, diagnosis -> report`
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from workbench import residuals as residuals
    from workbench.blocks import Block, Layout, Points, Values, jacobian
    from workbench.bodies import Landmarks, SkinnedBody, dual_quaternion_blend, linear_blend
    from workbench.bodies.catalogue import load_body
    from workbench.bodies.files.saving import save_body
    from workbench.bodies.triangles import TriangleBody
    from workbench.comparison import Budget, Comparison
    from workbench.comparison.compare import compare
    from workbench.diagnostics import Diagnosis, diagnose
    from workbench.errors import WorkbenchError
    from workbench.geometry.camera import Camera
    from workbench.problem import Constraint, Linearization, Problem, sequence
    from workbench.residuals import Residual
    from workbench.sampling import Posterior, laplace, sample
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
    from workbench.training.first_guess import Start
    from workbench.training.registrations import InMemory, Registrations
    from workbench.training.training import Trained, train

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
    "InMemory",
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
    "Registrations",
    "Residual",
    "Scipy",
    "SkinnedBody",
    "Solution",
    "Sqp",
    "Staged",
    "Start",
    "Status",
    "SteepestDescent",
    "Trained",
    "TriangleBody",
    "Values",
    "WorkbenchError",
    "compare",
    "diagnose",
    "dual_quaternion_blend",
    "jacobian",
    "laplace",
    "linear_blend",
    "load_body",
    "residuals",
    "sample",
    "save_body",
    "sequence",
    "solve",
    "train",
]

ROOMS = {  # where the names above live
    "blocks": ("Block", "Layout", "Points", "Values", "jacobian"),
    "bodies": ("Landmarks", "SkinnedBody", "dual_quaternion_blend", "linear_blend"),
    "bodies.catalogue": ("load_body",),
    "bodies.files.saving": ("save_body",),
    "bodies.triangles": ("TriangleBody",),
    "comparison": ("Budget", "Comparison", "compare"),
    "diagnostics": ("Diagnosis", "diagnose"),
    "errors": ("WorkbenchError",),
    "geometry.camera": ("Camera",),
    "problem": ("Constraint", "Linearization", "Problem", "sequence"),
    "residuals": ("Residual",),
    "sampling": ("Posterior", "laplace", "sample"),
    "solvers": (
        "SOLVERS",
        "Dogleg",
        "GaussNewton",
        "Ipopt",
        "LevenbergMarquardt",
        "Newton",
        "Nlopt",
        "Scipy",
        "Solution",
        "Sqp",
        "Staged",
        "Status",
        "SteepestDescent",
        "solve",
    ),
    "training.first_guess": ("Start",),
    "training.registrations": ("InMemory", "Registrations"),
    "training.training": ("Trained", "train"),
}


def __getattr__(name: str) -> Any:
    """A name, or a room, is loaded when it is asked for: all of them take seconds, and until a
    command has begun, nobody minds an interrupt.
    """
    for room, names in ROOMS.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{room}"), name)
    if find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
