"""What users may rely on; a change here is a line in the changelog."""

import workbench
from workbench import residuals

WORKBENCH = [
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
]
RESIDUALS = [
    "Kernel",
    "Residual",
    "gaussian",
    "geman_mcclure",
    "huber",
    "keypoints",
    "landmarks",
    "quadratic",
    "stitching",
    "vertices",
]
SOLVERS = [
    "gauss-newton",
    "levenberg-marquardt",
    "ipopt",
    "ipopt-exact",
    "nlopt-lbfgs",
    "nlopt-tnewton",
    "nlopt-slsqp",
    "nlopt-mma",
    "nlopt-bobyqa",
]


def test_the_names_are_these() -> None:
    assert workbench.__all__ == WORKBENCH
    assert residuals.__all__ == RESIDUALS
    assert list(workbench.SOLVERS) == SOLVERS


def test_every_name_is_there() -> None:
    for module, names in ((workbench, WORKBENCH), (residuals, RESIDUALS)):
        missing = [name for name in names if not hasattr(module, name)]
        assert not missing
