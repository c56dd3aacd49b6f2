"""A symbolic workbench for parametric body models: build, fit, diagnose, sample.

`values -> blocks -> symbolic points -> residuals -> problem -> solver, diagnosis -> report`
"""

import ast
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from workbench import residuals as residuals
    from workbench.blocks import Block, Layout, Points, Values, jacobian
    from workbench.bodies import Landmarks, SkinnedBody, dual_quaternion_blend, linear_blend
    from workbench.bodies.catalogue import load_body
    from workbench.bodies.files.saving import save_body
    from workbench.bodies.triangles import TriangleBody
    from workbench.comparison import Budget, Comparison, Record, TargetOutcome
    from workbench.comparison.compare import compare
    from workbench.diagnostics import (
        Candidate,
        Criterion,
        Diagnosis,
        Direction,
        Finding,
        MeasurementDesign,
        Quantity,
        SequenceDiagnosis,
        Suggestion,
        a_optimal,
        d_optimal,
        design,
        diagnose,
        e_optimal,
        sd_of,
    )
    from workbench.errors import WorkbenchError
    from workbench.experiments import Experiment
    from workbench.fitting import KnownAnswer, Measure, Setup, View
    from workbench.fitting.measures import measured, measures
    from workbench.geometry.camera import Camera
    from workbench.geometry.meshes import Mesh
    from workbench.geometry.surface_tree import ClosestPoints, closest
    from workbench.motions import Motion, read_motion, save_motion
    from workbench.problem import Constraint, Linearization, Problem, sequence
    from workbench.reports.replays import show
    from workbench.residuals import Residual
    from workbench.sampling import Posterior, laplace, sample
    from workbench.solvers import (
        SOLVERS,
        Abilities,
        Dogleg,
        Evaluations,
        GaussNewton,
        Hypothesis,
        Ipopt,
        Iterate,
        LevenbergMarquardt,
        Newton,
        Nlopt,
        Scipy,
        Solution,
        Solver,
        SolveStage,
        Spread,
        Sqp,
        Staged,
        Starts,
        Status,
        SteepestDescent,
        TrustRegion,
        solve,
    )
    from workbench.training.blocks import BlockOptions, Plan, Stage
    from workbench.training.estimate import Sigmas
    from workbench.training.first_guess import Start
    from workbench.training.registrations import Batch, InMemory, Registrations
    from workbench.training.rigging.joints import JointCandidate
    from workbench.training.rigging.rig import Rigged, rig
    from workbench.training.training import Trained, train

__all__ = [
    "SOLVERS",
    "Abilities",
    "Batch",
    "Block",
    "BlockOptions",
    "Budget",
    "Camera",
    "Candidate",
    "ClosestPoints",
    "Comparison",
    "Constraint",
    "Criterion",
    "Diagnosis",
    "Direction",
    "Dogleg",
    "Evaluations",
    "Experiment",
    "Finding",
    "GaussNewton",
    "Hypothesis",
    "InMemory",
    "Ipopt",
    "Iterate",
    "JointCandidate",
    "KnownAnswer",
    "Landmarks",
    "Layout",
    "LevenbergMarquardt",
    "Linearization",
    "Measure",
    "MeasurementDesign",
    "Mesh",
    "Motion",
    "Newton",
    "Nlopt",
    "Plan",
    "Points",
    "Posterior",
    "Problem",
    "Quantity",
    "Record",
    "Registrations",
    "Residual",
    "Rigged",
    "Scipy",
    "SequenceDiagnosis",
    "Setup",
    "Sigmas",
    "SkinnedBody",
    "Solution",
    "SolveStage",
    "Solver",
    "Spread",
    "Sqp",
    "Stage",
    "Staged",
    "Start",
    "Starts",
    "Status",
    "SteepestDescent",
    "Suggestion",
    "TargetOutcome",
    "Trained",
    "TriangleBody",
    "TrustRegion",
    "Values",
    "View",
    "WorkbenchError",
    "a_optimal",
    "closest",
    "compare",
    "d_optimal",
    "design",
    "diagnose",
    "dual_quaternion_blend",
    "e_optimal",
    "jacobian",
    "laplace",
    "linear_blend",
    "load_body",
    "measured",
    "measures",
    "read_motion",
    "residuals",
    "rig",
    "sample",
    "save_body",
    "save_motion",
    "sd_of",
    "sequence",
    "show",
    "solve",
    "train",
]


@cache
def _modules() -> dict[str, str]:
    """The module of each public name, by the imports above, which only type checkers carry out."""
    module = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    imports = next(node.body for node in module.body if isinstance(node, ast.If))
    statements = (node for node in imports if isinstance(node, ast.ImportFrom))
    public = {name.name: str(of.module) for of in statements for name in of.names}
    return {name: path for name, path in public.items() if path != __name__}


def __getattr__(name: str) -> Any:
    """Load a public name or a package when it is first used.

    To load all of them takes seconds, in which an interrupt would not be handled yet.
    """
    if name in _modules():
        return getattr(import_module(_modules()[name]), name)
    if find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.{name}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
