"""Targets, outcomes and profiles, of runs and tables made by hand."""

import numpy as np
import pytest

from tests.comparison.made_up import comparison, record
from workbench.comparison import RunEnding, TargetOutcome
from workbench.comparison.advice import advice
from workbench.comparison.comparison import by_effort
from workbench.comparison.record import Record
from workbench.comparison.statistics import data_profile, performance_profile, ratios
from workbench.comparison.targets import ReferenceCosts, target_outcome

COSTS = ReferenceCosts(start=100.0, best=1.0, origin="")


def test_target_is_a_share_of_the_way_down() -> None:
    assert COSTS.target(0.1) == pytest.approx(1 + 9.9)
    run = record("p", "s", [80.0, 10.0, 1.5])
    row = COSTS.reached_at(run, 0.1)
    assert row is not None
    assert row[0] == 2
    assert COSTS.reached_at(run, 1e-3) is None
    assert COSTS.reached_at(record("p", "s", []), 0.1) is None


def test_forbidden_start_makes_the_lowest_cost_the_target() -> None:
    costs = ReferenceCosts(start=0.5, best=1.0, origin="")
    assert costs.reached_at(record("p", "s", [1.0 + 1e-7]), 1e-7) is not None
    assert costs.reached_at(record("p", "s", [1.0 + 1e-5]), 1e-1) is None


def test_without_a_finite_start_there_is_no_target() -> None:
    assert np.isnan(ReferenceCosts(np.inf, 1.0, "").target(0.1))
    assert ReferenceCosts(np.nan, 1.0, "").reached_at(record("p", "s", [1.0]), 0.1) is None


RUNS: list[tuple[object, bool | None, TargetOutcome]] = [
    (record("p", "s", [1.0]), True, TargetOutcome.REACHED),
    (record("p", "s", [1.0], claim="STALLED", optimality=1e-3), True, TargetOutcome.REACHED),
    (
        record("p", "s", [1.01], optimality=1e-8),
        True,
        TargetOutcome.REACHED,
    ),  # flat, and settled
    (record("p", "s", [5.0]), False, TargetOutcome.OTHER_BASIN),
    (record("p", "s", [5.0], claim="STALLED"), False, TargetOutcome.OTHER_BASIN),
    (record("p", "s", [5.0], optimality=0.1), True, TargetOutcome.FALSE_CLAIM),
    (record("p", "s", [5.0], optimality=np.nan), False, TargetOutcome.FALSE_CLAIM),
    (record("p", "s", [5.0], claim="STALLED", optimality=0.1), True, TargetOutcome.STALLED),
    (
        record("p", "s", [5.0], claim="MAX_SECONDS", optimality=0.1),
        None,
        TargetOutcome.OUT_OF_BUDGET,
    ),
    (record("p", "s", [], ending=RunEnding.RAISED), None, TargetOutcome.RAISED),
    (record("p", "s", [1.0], ending=RunEnding.KILLED), None, TargetOutcome.NOT_STOPPING),
    (record("p", "s", [1.0], ending=RunEnding.CRASHED), None, TargetOutcome.CRASHED),
    (record("p", "s", [1.0], ending=RunEnding.REFUSED), None, TargetOutcome.REFUSED),
    (record("p", "s", [np.nan]), None, TargetOutcome.NO_SOLUTION),
    (record("p", "s", [np.nan], ending=RunEnding.CUT), None, TargetOutcome.OUT_OF_BUDGET),
]


def test_outcomes_of_runs() -> None:
    for run, lowest, expected in RUNS:
        assert target_outcome(run, COSTS, lowest, 1e-6) is expected  # type: ignore[arg-type]


SADDLE, INSENSITIVE = TargetOutcome.SADDLE, TargetOutcome.INSENSITIVE
NO_FINITE_MINIMUM, DIVERGED = TargetOutcome.NO_FINITE_MINIMUM, "NO_FINITE_MINIMUM"


NO_MINIMA: list[tuple[object, bool | None, bool, TargetOutcome | None]] = [
    (record("p", "s", [5.0]), False, True, SADDLE),  # whatever the solver says
    (record("p", "s", [5.0], claim="SADDLE"), False, False, SADDLE),
    (record("p", "s", [5.0], claim="SADDLE", optimality=0.1), None, False, None),
    (record("p", "s", [5.0], claim=DIVERGED), False, False, NO_FINITE_MINIMUM),
    (record("p", "s", [5.0], claim=DIVERGED, optimality=0.1), None, False, NO_FINITE_MINIMUM),
    (record("p", "s", [5.0], claim="INSENSITIVE", optimality=0.1), False, False, INSENSITIVE),
    (record("p", "s", [1.0], claim="INSENSITIVE", optimality=0.1), True, False, None),
    (record("p", "s", [1.0], claim="SADDLE"), True, True, None),
]


def test_outcomes_of_ends_that_are_no_minimum() -> None:
    """They are told from minima above the lowest cost; at the lowest cost, the cost decides."""
    for run, lowest, at_saddle, expected in NO_MINIMA:
        outcome = target_outcome(run, COSTS, lowest, 1e-6, at_saddle)  # type: ignore[arg-type]
        if expected is None:
            assert outcome in (TargetOutcome.REACHED, TargetOutcome.STALLED)
        else:
            assert outcome is expected


def test_lowest_cost_is_that_of_all() -> None:
    compared = comparison({("p", "a"): [9.0, 3.0], ("p", "b"): [9.0, 4.0]}, basins={("p", "b"): 1})
    assert compared.references["p"].best == 3
    assert compared.outcomes["p", "a"] is TargetOutcome.REACHED
    assert compared.outcomes["p", "b"] is TargetOutcome.OTHER_BASIN
    assert compared.success("b", 1e-3).value == 0


def test_visited_points_count_for_targets_only() -> None:
    lost = record("p", "a", [2.0, 0.5], ending=RunEnding.KILLED)
    compared = comparison({("p", "a"): [], ("p", "b"): [9.0, 4.0]}, lost=lost)
    assert compared.references["p"].best == 0.5
    assert compared.success("a", 1e-7).value == 1
    assert compared.reached("a").value == 0


def test_only_end_is_compared_with_nothing() -> None:
    """Nothing else ended and no cost is known: neither lowest, nor on target, nor advised."""
    compared = comparison({("p", "a"): [9.0, 1.0], ("q", "a"): [2.0]})
    assert compared.comparable == ()
    assert {*compared.outcomes.values()} == {TargetOutcome.ALONE}
    assert np.isnan(compared.success("a", 1e-5).value)
    assert np.isnan(compared.reached("a").value)
    (said,) = advice(compared)
    assert said.startswith("There is nothing to compare")
    known = comparison({("p", "a"): [9.0, 1.0]}, known=True)
    assert known.comparable == known.instances
    assert known.success("a", 1e-5).value == 0  # 0 is known, and it ended at 1
    mixed = comparison(
        {("p", "a"): [9.0, 1.0], ("p", "b"): [], ("q", "a"): [2.0], ("q", "b"): [2.0]}
    )
    assert [i.name for i in mixed.comparable] == ["q"]
    assert advice(mixed)[0].startswith("1 of 2 starts are left out")


INF = np.inf
TIMES = [[1.0, 2.0, INF], [4.0, 2.0, 8.0], [INF, INF, INF], [3.0, 3.0, 6.0]]


def test_ratios_are_to_the_best_on_each_problem() -> None:
    expected = [[1, 2, INF], [2, 1, 4], [INF, INF, INF], [1, 1, 2]]
    np.testing.assert_array_equal(ratios(TIMES), expected)


def test_performance_profile_counts_within_alpha_of_the_best() -> None:
    profile = performance_profile(TIMES, [1, 2, 4, 100])
    np.testing.assert_allclose(profile[0], [0.5, 0.5, 0.0])  # a tie is a win of both
    np.testing.assert_allclose(profile[1], [0.75, 0.75, 0.25])
    np.testing.assert_allclose(profile[2], [0.75, 0.75, 0.5])
    np.testing.assert_allclose(profile[3], [0.75, 0.75, 0.5])  # nobody solves the third


def test_a_data_profile_counts_simplex_gradients() -> None:
    profile = data_profile(TIMES, [0, 1, 1, 2], [1, 2, 4])  # divided by 1, 2, 2, 3
    np.testing.assert_allclose(profile[0], [0.5, 0.5, 0.0])
    np.testing.assert_allclose(profile[1], [0.75, 0.75, 0.25])
    np.testing.assert_allclose(profile[2], [0.75, 0.75, 0.5])


def test_effort_is_read_from_traces() -> None:
    compared = comparison(
        {
            ("p", "a"): [50.0, 9.0, 0.0],
            ("p", "b"): [100.0, 10.0, 0.0],
            ("q", "a"): [100.0],
            ("q", "b"): [5.0, 0.0],
        }
    )
    np.testing.assert_array_equal(compared.needed(0.1), [[2, 2], [INF, 1]])
    np.testing.assert_array_equal(compared.needed(1e-3), [[3, 3], [INF, 2]])
    duel = by_effort(compared, 1e-3)["a", "b"]
    assert (duel.first, duel.second, duel.ties, duel.both_fail) == (0, 1, 1, 0)


def test_older_records_have_the_present_names_of_statuses() -> None:
    for old, new in (("LOST", "INSENSITIVE"), ("VALLEY", "NO_FINITE_MINIMUM"), ("", "")):
        assert Record.of(record("p", "s", [1.0], claim=old).stored()).claim == new
