"""The same problems given to SciPy directly end at the same costs."""

import numpy as np
import pytest
import scipy.optimize

import workbench as wb
from workbench.experiments.catalogue import find
from workbench.problem import Problem

pytestmark = pytest.mark.thorough

PROBLEMS = (
    "nist-misra1a",
    "nist-rat42",
    "nist-gauss1",
    "nist-kirby2",
    "more-wild-watson-9",
    "more-wild-kowalik-osborne",
    "body-vertices",
    "body-joints",
    "body-four-cameras",
    "body-outliers-huber",
)
OURS = ("levenberg-marquardt-columns", "scipy-trf")
BASINS = {"body-outliers-huber": ("levenberg-marquardt", "scipy-trf")}  # columns end in another one


def posed(name: str) -> tuple[Problem, wb.Values, np.ndarray, np.ndarray]:
    setup = find(name).setup()
    return setup.problem, setup.start, *setup.problem.split(setup.start)


def assert_same_cost(problem: Problem, start: wb.Values, theirs: float, of: str) -> None:
    began = problem.linearize(start).cost
    for name in BASINS.get(of, OURS):
        ours = wb.SOLVERS[name].solve(problem, start).cost
        assert abs(ours - theirs) <= 1e-6 * theirs + 1e-12 * began, (name, ours, theirs)


@pytest.mark.parametrize("name", PROBLEMS)
def test_scipy_asked_directly(name: str) -> None:
    problem, start, x, fixed = posed(name)
    found = scipy.optimize.least_squares(
        lambda x: problem.residual(x, fixed),
        x,
        jac=lambda x: problem.linearize_at(x, fixed).jacobian,
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
        max_nfev=1000,
    )
    assert_same_cost(problem, start, found.cost, name)
