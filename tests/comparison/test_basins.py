"""Basins and lost ones, of problems where both are known."""

import numpy as np
import pytest

from tests.comparison.problems import STARTS, angle, lost_well, slide
from workbench.comparison.basins import basins
from workbench.comparison.end_analysis import analyse_ends
from workbench.comparison.explanation import explain
from workbench.experiments import find
from workbench.solvers import SOLVERS


def test_ends_go_to_the_wells_that_levenberg_marquardt_leads_to() -> None:
    setup = slide()
    fixed = setup.problem.split(setup.start)[1]
    ends = [np.array(x) for x in (*STARTS, (0.0, 1.0), (0.0, lost_well()), (0.1, -0.9))]
    found, where = basins(setup.problem, fixed, ends)
    assert where == (0, 1, 0, 0, 1, 1)
    np.testing.assert_allclose([b.x for b in found], [[0, 1], [0, lost_well()]], atol=1e-7)
    assert found[0].cost < 1e-20 < found[1].cost
    again, reverse = basins(setup.problem, fixed, ends[::-1])
    assert reverse == where[::-1]
    np.testing.assert_allclose([b.cost for b in again], [b.cost for b in found], atol=1e-20)


def test_what_the_residuals_cannot_tell_apart_is_one_basin() -> None:
    setup = angle()
    fixed = setup.problem.split(setup.start)[1]
    turns = [np.array([0.2 + 2 * np.pi * k]) for k in (0, 1, -3)]
    found, where = basins(setup.problem, fixed, turns)
    assert where == (0, 0, 0)
    assert len(found) == 1
    other, _ = basins(setup.problem, fixed, [*turns, np.array([np.arctan2(0.5, 1) + np.pi])])
    assert len(other) == 2  # the top of the hill: stationary, and dearer


def test_a_slide_is_explained_by_the_direction_along_which_it_went() -> None:
    setup = slide()
    problem, fixed = setup.problem, setup.problem.split(setup.start)[1]
    found, _ = basins(problem, fixed, [np.array(x) for x in STARTS])
    told = explain(problem, fixed, found[1], found[0])
    assert told.length == pytest.approx(1 - lost_well())
    assert told.share == pytest.approx(1.0)
    (part,) = told.components
    assert "x[b]" in part.name
    assert part.length == pytest.approx(1 - lost_well())
    assert part.change == pytest.approx(0.2, rel=0.05)  # |d(hardly seen)/db|
    top = 0.5 * (0.1**2 + 0.02**2)  # near b = 0
    assert told.ridge == pytest.approx(top - found[1].cost, rel=0.05)
    assert "100% of the way from here to there (1.98 units) goes along weak" in str(told)
    assert "x[b]" in str(told)


def test_another_minimum_is_not_called_a_slide() -> None:
    setup = angle()
    problem, fixed = setup.problem, setup.problem.split(setup.start)[1]
    top = np.arctan2(0.5, 1) + np.pi
    found, _ = basins(problem, fixed, [np.array([0.2]), np.array([top])])
    told = explain(problem, fixed, found[1], found[0])
    assert "not a slide" in str(told)
    assert told.ridge == 0  # it only falls from there


def test_a_body_in_one_image_slid_along_turns_that_the_image_hardly_shows() -> None:
    setup = find("balance-monocular").setup()
    solutions = [
        SOLVERS[name].solve(setup.problem, setup.start)
        for name in ("levenberg-marquardt", "gauss-newton")
    ]
    found = analyse_ends(setup, tuple(setup.problem.free.pack(s.values) for s in solutions))
    assert found.where == (1, 0)
    told = found.explanations[1]
    assert told.cost - told.best == pytest.approx(solutions[0].cost - solutions[1].cost, rel=1e-3)
    assert 0.5 < told.share <= 1
    assert all(part.change < 2 for part in told.components)  # sigmas for a radian
    assert "a turn of pose[" in told.components[0].name


def test_a_start_where_nothing_is_finite_has_no_basin_to_explain() -> None:
    setup = slide()
    found = analyse_ends(setup, (np.array([np.inf, 0.0]), np.array([0.0, 1.0])))
    assert found.where[1] == 0
    assert not found.explanations
