"""Laplace's approximation is called usable where it is right, and only there."""

from dataclasses import dataclass

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.sampling.densities import bounded, gaussian, rosenbrock, two_modes
from tests.tiers import few
from workbench.sampling import NotConverged, Posterior, laplace

LEVELS, OFF = (0.05, 0.25, 0.5, 0.75, 0.95), 0.05  # quantiles, and how far off they may be
NOISE = 4 * 0.5 / np.sqrt(4000)  # of the level of a quantile of 4000 draws
Grid = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Case:
    """A posterior of one or two numbers, where to begin, and a box that holds nearly all of it."""

    problem: wb.Problem
    at: dict[str, object]
    box: Grid
    right: bool  # whether its quantiles are Laplace's to 0.05


def of_one(expression: object, at: float, box: Grid, right: bool, **bounds: object) -> Case:
    x = wb.Block("x")
    found = wb.Residual("r", expression(x.symbol), 1.0)  # type: ignore[operator]
    return Case(wb.Problem([found], "x", dict(bounds), [x]), {"x": at}, box, right)  # type: ignore[arg-type]


def student(x: cs.MX) -> cs.MX:
    """Three degrees of freedom: a cost of 2 log(1 + x^2 / 3), smooth in its root."""
    s = x**2 + 1e-9
    return x * cs.sqrt(4 * cs.log1p(s / 3) / s)


CASES = {
    "gaussian": Case(
        gaussian(np.array([[1.0, 0.9], [0.9, 1.0]])), {"x": np.zeros(2)}, ((-6, 6), (-6, 6)), True
    ),
    "nearly linear": of_one(lambda x: cs.sinh(0.05 * x) / 0.05, 0.0, ((-7, 7),), True),
    "on a bound": of_one(lambda x: x + 3, 0.0, ((0, 4),), True, x=(0.0, np.inf)),
    "half": of_one(lambda x: x, 0.0, ((0, 6),), True, x=(0.0, np.inf)),
    "beside a bound": Case(bounded(), {"x": [1.0, 0.0]}, ((1, 7), (-6, 6)), True),
    "banana": Case(rosenbrock(1.0), {"x": np.ones(2)}, ((-5, 7), (-3, 45)), False),
    "long banana": Case(rosenbrock(10.0), {"x": np.ones(2)}, ((-15, 17), (-3, 290)), False),
    "exponential": of_one(lambda x: 2 * (cs.exp(x) - 1), 0.0, ((-30, 3),), False, x=(-30.0, 30.0)),
    "logarithm": of_one(lambda x: cs.log(x), 1.0, ((1e-6, 300),), False, x=(1e-6, 300.0)),
    "heavy tails": of_one(student, 0.1, ((-300, 300),), False, x=(-300.0, 300.0)),
    "square": of_one(lambda x: x**2 - 1, 1.0, ((-4, 4),), False),
    "near wells": Case(two_modes(2.0), {"x": [2.0, 0.0]}, ((-8, 8), (-6, 6)), False),
    "wells": Case(two_modes(12.0), {"x": [12.0, 0.0]}, ((-18, 18), (-6, 6)), False),
    "cubic": of_one(lambda x: x + x**3, 0.0, ((-4, 4),), False),
}


def worst(case: Case, posterior: Posterior) -> float:
    """By how much the level of a quantile is off, at the most, against a grid."""
    fine = 40_001 if len(case.box) == 1 else 701
    axes = [np.linspace(low, high, fine) for low, high in case.box]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    x, given = case.problem.split(case.at)  # type: ignore[arg-type]
    with np.errstate(all="ignore"):
        cost = np.concatenate(
            [case.problem.costs(x, given)(part) for part in np.array_split(grid, 20)]
        )
    density = np.exp(np.nanmin(cost) - np.nan_to_num(cost, nan=np.inf)).reshape([fine] * len(axes))
    off = 0.0
    for i, axis in enumerate(axes):
        mass = density.sum(axis=tuple(j for j in range(len(axes)) if j != i))
        below = np.cumsum(mass) / mass.sum()
        ends = np.quantile(posterior.flat[:, i], LEVELS)
        off = max(off, float(np.abs(np.interp(ends, axis, below) - LEVELS).max()))
    return off


@pytest.mark.parametrize("name", few(CASES, ("nearly linear", "on a bound", "logarithm", "square")))
def test_verdict_is_that_of_a_grid(name: str) -> None:
    case = CASES[name]
    posterior = laplace(case.problem, case.at)  # type: ignore[arg-type]
    off = worst(case, posterior)
    assert (off < OFF) == case.right, off  # the case is what it says
    assert posterior.usable == case.right, (off, posterior.verdict)
    assert "R-hat" not in str(posterior)
    if not case.right:
        assert not str(posterior).startswith("usable")
        with pytest.raises(NotConverged):
            posterior.interval()


def test_told_error_is_the_true_one() -> None:
    """Where weights can be trusted, what they say is off is off by that."""
    posterior = laplace(CASES["cubic"].problem, CASES["cubic"].at)  # type: ignore[arg-type]
    assert posterior.importance is not None
    assert posterior.importance.k_hat < 0.7
    off = worst(CASES["cubic"], posterior)
    assert off > OFF
    assert posterior.importance.error == pytest.approx(off, abs=2 * NOISE)
