"""What counts as success, and what becomes of a run, by the problem's numbers alone."""

import numpy as np
import pytest

from tests.comparison.made_up import comparison, record
from workbench.comparison import Ending, Verdict
from workbench.comparison.targets import Yardstick, verdict
from workbench.comparison.words import advice, surest

YARD = Yardstick(start=100.0, best=1.0, origin="")


def test_a_target_is_a_share_of_the_whole_way_down() -> None:
    assert YARD.target(0.1) == pytest.approx(1 + 9.9)
    run = record("p", "s", [80.0, 10.0, 1.5])
    row = YARD.met(run, 0.1)
    assert row is not None
    assert row[0] == 2
    assert YARD.met(run, 1e-3) is None
    assert YARD.met(record("p", "s", []), 0.1) is None


def test_whoever_starts_at_the_minimum_is_there_despite_rounding() -> None:
    yard = Yardstick(start=1.0, best=1.0 - 1e-16, origin="")
    assert yard.met(record("p", "s", [1.0]), 1e-7) is not None


def test_without_a_finite_start_there_is_no_target() -> None:
    assert np.isnan(Yardstick(np.inf, 1.0, "").target(0.1))
    assert Yardstick(np.nan, 1.0, "").met(record("p", "s", [1.0]), 0.1) is None


@pytest.mark.parametrize(
    ("run", "lowest", "expected"),
    [
        (record("p", "s", [1.0]), True, Verdict.REACHED),
        (record("p", "s", [1.0], claim="STALLED", optimality=1e-3), True, Verdict.REACHED),
        (record("p", "s", [1.01], optimality=1e-8), True, Verdict.REACHED),  # flat, and settled
        (record("p", "s", [5.0]), False, Verdict.OTHER_BASIN),
        (record("p", "s", [5.0], claim="STALLED"), False, Verdict.OTHER_BASIN),
        (record("p", "s", [5.0], optimality=0.1), True, Verdict.FALSE_CLAIM),
        (record("p", "s", [5.0], optimality=np.nan), False, Verdict.FALSE_CLAIM),
        (record("p", "s", [5.0], claim="STALLED", optimality=0.1), True, Verdict.STALLED),
        (record("p", "s", [5.0], claim="MAX_SECONDS", optimality=0.1), None,
         Verdict.OUT_OF_BUDGET),
        (record("p", "s", [], ending=Ending.RAISED), None, Verdict.RAISED),
        (record("p", "s", [1.0], ending=Ending.KILLED), None, Verdict.NOT_STOPPING),
        (record("p", "s", [1.0], ending=Ending.CRASHED), None, Verdict.CRASHED),
        (record("p", "s", [1.0], ending=Ending.REFUSED), None, Verdict.REFUSED),
        (record("p", "s", [np.nan]), None, Verdict.NO_SOLUTION),
        (record("p", "s", [np.nan], ending=Ending.CUT), None, Verdict.OUT_OF_BUDGET),
    ],
)  # fmt: skip
def test_verdicts(run: object, lowest: bool | None, expected: Verdict) -> None:
    assert verdict(run, YARD, lowest, 1e-6) is expected  # type: ignore[arg-type]


def test_the_lowest_cost_of_anybody_is_the_yardstick_of_all() -> None:
    found = comparison({("p", "a"): [9.0, 3.0], ("p", "b"): [9.0, 4.0]}, basins={("p", "b"): 1})
    assert found.yardsticks["p"].best == 3
    assert found.verdicts["p", "a"] is Verdict.REACHED
    assert found.verdicts["p", "b"] is Verdict.OTHER_BASIN
    assert found.success("b", 1e-3).value == 0


def test_a_point_that_was_visited_and_not_returned_counts_for_targets_only() -> None:
    lost = record("p", "a", [2.0, 0.5], ending=Ending.KILLED)
    found = comparison({("p", "a"): [], ("p", "b"): [9.0, 4.0]}, lost=lost)
    assert found.yardsticks["p"].best == 0.5
    assert found.success("a", 1e-7).value == 1
    assert found.reached("a").value == 0


def test_all_fail() -> None:
    found = comparison({("p", "a"): [], ("p", "b"): []})
    assert np.isinf(found.needed(0.1)).all()
    assert surest(found) == ()
    assert advice(found) == ("No solver met the target τ = 1e-5 from any of the 1 starts.",)
    assert found.duel("a", "b").both_fail == 1


def test_a_single_solver_is_compared_with_nobody() -> None:
    found = comparison({("p", "a"): [9.0, 1.0], ("q", "a"): [2.0]})
    assert advice(found) == ("a met the target τ = 1e-5 from 2 of 2 starts.",)


def test_ties_are_said_to_be_ties() -> None:
    found = comparison({(p, s): [9.0, 1.0] for p in "pqrstuv" for s in "ab"})
    said = " ".join(advice(found))
    assert "a and b met the target τ = 1e-5 from 7 of 7 starts each." in said
    assert "beyond chance: more starts would be needed" in said


def test_the_quicker_of_two_that_are_as_sure_is_named_when_chance_is_ruled_out() -> None:
    runs = {(p, "quick"): [9.0, 1.0] for p in "pqrstuv"}
    slow = {(p, "slow"): [9.0, 8.0, 7.0, 6.0, 1.0] for p in "pqrstuv"}
    said = " ".join(advice(comparison(runs | slow)))
    assert "take quick when effort counts" in said
    few = comparison({k: v for k, v in (runs | slow).items() if k[0] in "pq"})
    assert "take quick" not in " ".join(advice(few))  # two starts say nothing
