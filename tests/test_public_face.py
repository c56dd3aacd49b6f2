"""What users may rely on; a change here is a line in the changelog."""

import subprocess
import sys

import pytest

import workbench
from workbench import residuals

WORKBENCH = [
    "SOLVERS",
    "Abilities",
    "Batch",
    "Block",
    "BlockOptions",
    "Budget",
    "Camera",
    "Candidate",
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
RESIDUALS = [
    "HINGES",
    "Form",
    "Hinge",
    "Kernel",
    "Residual",
    "apart",
    "bending",
    "distance",
    "edges",
    "free_space",
    "gaps",
    "gaussian",
    "geman_mcclure",
    "huber",
    "keypoints",
    "landmarks",
    "limits",
    "log_sum_mixture",
    "loose",
    "max_mixture",
    "mirrored",
    "model_to_scan",
    "of_norms",
    "offset",
    "on_plane",
    "plane",
    "quadratic",
    "regressed",
    "scaled",
    "scan_to_model",
    "smooth",
    "spheres",
    "stitching",
    "student_t",
    "vertices",
]
SOLVERS = [
    "trust-region",
    "gauss-newton",
    "gauss-newton-full",
    "levenberg-marquardt",
    "levenberg-marquardt-columns",
    "dogleg",
    "dogleg-chumpy",
    "steepest-descent",
    "newton",
    "ipopt",
    "ipopt-exact",
    "ipopt-lbfgs",
    "sqp",
    "scipy-trf",
    "scipy-dogbox",
    "scipy-lm",
    "nlopt-lbfgs",
    "nlopt-tnewton",
    "nlopt-var2",
    "nlopt-slsqp",
    "nlopt-mma",
    "nlopt-ccsaq",
    "nlopt-bobyqa",
    "nlopt-mlsl",
]


def test_the_names_are_these() -> None:
    for names, kept in (
        (workbench.__all__, WORKBENCH),
        (residuals.__all__, RESIDUALS),
        (list(workbench.SOLVERS), SOLVERS),
    ):
        changed = sorted({*names} ^ {*kept})
        assert names == kept, (
            f"{changed} came or went, or the order changed: change the list above, and tell users "
            "in CHANGELOG.md"
        )


def test_every_name_is_there() -> None:
    for module, names in ((workbench, WORKBENCH), (residuals, RESIDUALS)):
        missing = [name for name in names if not hasattr(module, name)]
        assert not missing
    with pytest.raises(AttributeError, match="no attribute 'smaple'"):
        _ = workbench.smaple  # type: ignore[attr-defined]  # a wrong name stays one


def test_importing_does_not_load_the_sampler() -> None:
    said = (
        "import sys, workbench as wb; early = {'emcee', 'scipy.stats'} & {*sys.modules}; "
        "print(early, wb.sampling.sample is wb.sample, 'emcee' in sys.modules, "
        "'laplace' in dir(wb))"
    )
    found = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["set()", "True", "False", "True"]
