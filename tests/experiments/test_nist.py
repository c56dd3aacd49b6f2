"""NIST's regressions: what is certified is what our formulas and our covariance give."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.tiers import few
from workbench.errors import BadArgument, UnknownName
from workbench.experiments import SUITES, Setup, find
from workbench.experiments.nist import MODELS, certified
from workbench.fitting.setup import KnownAnswer, digits
from workbench.solvers import SOLVERS

NAMES = [experiment.name for experiment in SUITES["nist"]]
GRADIENT_TOLERANCE = 1e-12
LEAST_DIGITS = {  # of any run; identity scaling loses some where the tightest fit is Lanczos3
    "trust-region": 7.5,
    "levenberg-marquardt-columns": 8,
    "ipopt-exact": 8,
}


def built(name: str, start: int = 1) -> tuple[Setup, KnownAnswer]:
    setup = find(name, {"start": start}).setup()
    assert setup.known is not None
    return setup, setup.known


def test_certified_sums_of_squares_come_out() -> None:
    assert len(NAMES) == 12 == len(certified()) == len(MODELS)
    for name in NAMES:
        setup, known = built(name)
        assert known.values is not None
        assert known.cost is not None
        cost = setup.problem.linearize(known.values).cost
        if name == "nist-lanczos1":  # parameters of 11 digits leave 1e-11, the residual is 1e-13
            assert cost < 1e-20
        else:
            assert cost == pytest.approx(known.cost, rel=1e-10), name
        dof = setup.problem.size - setup.problem.free.size
        deviation = np.sqrt(2 * known.cost / dof)
        assert known.residual_deviation == pytest.approx(deviation, rel=1e-10), name


def test_laplace_deviations_have_nine_certified_digits() -> None:
    for name in NAMES:
        setup, known = built(name)
        assert known.values is not None
        assert known.deviations is not None
        assert known.residual_deviation is not None
        here = setup.problem.linearize(known.values)
        deviations = known.residual_deviation * np.sqrt(np.diag(here.covariance))
        assert digits({"b": deviations}, known.deviations) >= 9, name


def test_starts_differ_and_others_are_refused() -> None:
    first, second = built("nist-misra1a", 1)[0], built("nist-misra1a", 2)[0]
    assert first.start["b"].tolist() == [500, 1e-4]
    assert second.start["b"].tolist() == [250, 5e-4]
    with pytest.raises(UnknownName, match="no start is called '3'; there are 1 and 2"):
        built("nist-misra1a", 3)
    with pytest.raises(BadArgument, match="start of nist-misra1a must be a whole number"):
        find("nist-misra1a", {"start": "near"})
    with pytest.raises(UnknownName, match="no NIST problem is called 'x'"):
        find("nist-misra1a", {"problem": "x"}).setup()


@pytest.mark.parametrize("solver", few(LEAST_DIGITS, 1))
def test_runs_are_solved_to_ten_digits_in_the_mean(solver: str) -> None:
    """Digits of the worst parameter, capped at 11; who claims to have converged has."""
    options: Any = SOLVERS[solver]
    tight = replace(options, gradient_tolerance=GRADIENT_TOLERANCE)
    digits_found = []
    for name in NAMES:
        for start in (1, 2):
            setup, known = built(name, start)
            solution = tight.solve(setup.problem, setup.start)
            assert known.values is not None
            digits_found.append(min(11, digits(solution.values, known.values)))
            assert solution.optimality < 1e-9
    assert len(digits_found) == 24
    assert min(digits_found) > LEAST_DIGITS[solver]
    assert np.mean(digits_found) >= 10
