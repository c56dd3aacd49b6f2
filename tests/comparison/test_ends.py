"""Why runs end above the lowest cost: basins, saddles and outcomes that are known."""

import casadi as cs
import numpy as np
import pytest

from tests.comparison.made_up import in_this_process
from tests.comparison.problems import SLIDE, STARTS, Liar, angle, lost_well, slide
from workbench import Block, LevenbergMarquardt, Problem, Residual, compare
from workbench.comparison import Budget, TargetOutcome
from workbench.comparison.ends import (
    EndAnalysis,
    analyse_ends,
    basins,
    is_saddle,
)
from workbench.comparison.metered import look
from workbench.experiments import Experiment, Setup


def test_ends_go_to_the_wells_they_lead_to() -> None:
    setup = slide()
    fixed = setup.problem.split(setup.start)[1]
    ends = [np.array(x) for x in (*STARTS, (0.0, 1.0), (0.0, lost_well()), (0.1, -0.9))]
    minima, where = basins(setup.problem, fixed, ends)
    assert where == (0, 1, 0, 0, 1, 1)
    np.testing.assert_allclose([b.x for b in minima], [[0, 1], [0, lost_well()]], atol=1e-7)
    assert minima[0].cost < 1e-20 < minima[1].cost
    again, reverse = basins(setup.problem, fixed, ends[::-1])
    assert reverse == where[::-1]
    np.testing.assert_allclose([b.cost for b in again], [b.cost for b in minima], atol=1e-20)


def test_full_turns_are_one_basin() -> None:
    setup = angle()
    fixed = setup.problem.split(setup.start)[1]
    turns = [np.array([0.2 + 2 * np.pi * k]) for k in (0, 1, -3)]
    minima, where = basins(setup.problem, fixed, turns)
    assert where == (0, 0, 0)
    assert len(minima) == 1
    other, _ = basins(setup.problem, fixed, [*turns, np.array([np.arctan2(0.5, 1) + np.pi])])
    assert len(other) == 2  # the top of the hill: stationary, and dearer


def test_ends_that_are_not_finite_have_no_basin() -> None:
    setup = slide()
    analysis = analyse_ends(setup, (np.array([np.inf, 0.0]), np.array([0.0, 1.0])))
    assert analysis.where[1] == 0
    assert not any(analysis.saddles)


def test_saddles_are_told_from_wells() -> None:
    setup = slide()
    fixed = setup.problem.split(setup.start)[1]
    assert is_saddle(setup.problem, fixed, np.zeros(2))  # between two wells
    analysis = analyse_ends(setup, (np.array([0.0, 1.0]), np.array([0.0, lost_well()])))
    assert analysis.saddles == (False, False)
    assert EndAnalysis.of(analysis.stored()).saddles == analysis.saddles
    x = Block("x", (2,))
    hill = cs.vertcat(x.symbol[1], x.symbol[0] ** 2 - 4)  # zero is the top of a hill
    free = Problem([Residual("r", hill, 1.0)], ["x"])
    held = Problem([Residual("r", hill, 1.0)], ["x"], bounds={"x": ([0.0, -1], [0.0, 1])})
    assert is_saddle(free, np.zeros(0), np.zeros(2))
    assert not is_saddle(held, np.zeros(0), np.zeros(2))


def test_errors_of_residuals_show_no_saddle_and_other_errors_are_raised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*_: object) -> None:
        raise TypeError("a mistake")

    problem = slide().problem
    with monkeypatch.context() as patch:
        patch.setattr(Problem, "linearize_at", broken)  # as if the residual raised
        assert not is_saddle(problem, np.zeros(0), np.zeros(2))
        assert np.isnan(look(problem, np.zeros(2), np.zeros(0))).all()
    monkeypatch.setattr("workbench.comparison.ends.saddle", broken)
    monkeypatch.setattr(Problem, "optimality", broken)
    with pytest.raises(TypeError, match="a mistake"):
        is_saddle(problem, np.zeros(0), np.zeros(2))
    with pytest.raises(TypeError, match="a mistake"):
        look(problem, np.zeros(2), np.zeros(0))


def test_ends_of_a_comparison_have_outcomes() -> None:
    solvers = {"levenberg-marquardt": LevenbergMarquardt(), "stays": Liar()}
    with in_this_process():
        compared = compare([SLIDE], solvers, seeds=3)
        short = compare([SLIDE], solvers, budget=Budget(max_evaluations=3))
    outcomes = [compared.outcomes[f"slide, start {k}", "levenberg-marquardt"] for k in (0, 1)]
    assert outcomes == [TargetOutcome.REACHED, TargetOutcome.OTHER_BASIN]
    assert compared.outcome_counts("stays") == {TargetOutcome.FALSE_CLAIM: 3}
    ended = short.outcomes["slide, start 0", "levenberg-marquardt"]
    assert ended is TargetOutcome.OUT_OF_BUDGET


def test_stops_at_saddles_are_counted() -> None:
    """Both wells of the slide are known from other starts; the top between them is a saddle."""
    ridge = Experiment("ridge", _ridge, "", {})
    with in_this_process():
        compared = compare([ridge], {"lm": LevenbergMarquardt(), "stays": Liar()}, seeds=2)
    assert {run: record.claim for run, record in compared.records.items() if run[1] == "lm"} == {
        ("ridge, start 0", "lm"): "SADDLE",
        ("ridge, start 1", "lm"): "CONVERGED",
    }
    for solver in ("lm", "stays"):  # one says so, and the other does not
        assert compared.outcomes["ridge, start 0", solver] is TargetOutcome.SADDLE
        assert not compared.returned_within("ridge, start 0", solver, 0.9)
    assert compared.outcome_counts("lm")[TargetOutcome.REACHED] == 1


def _ridge(start: int = 0) -> Setup:
    """A start on the ridge between two minima, and one beside it."""
    x = Block("x", (2,))
    rows = cs.vertcat(x.symbol[0] ** 2 - 1, x.symbol[1], 1)
    problem = Problem([Residual("r", rows, 1.0)], ["x"])
    return Setup(problem, {"x": np.array([0.5 * start, 0.0])}, "is the ridge left?")
