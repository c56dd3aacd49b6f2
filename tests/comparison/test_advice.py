"""Advice: who is named, by what, and that no clock is asked."""

from dataclasses import replace

import numpy as np
import pytest

from tests.comparison.made_up import comparison, record
from workbench.comparison import Comparison
from workbench.comparison.advice import advice, prices_sentence, reliable
from workbench.comparison.comparison import by_effort
from workbench.comparison.targets import PRICES, units

QUICK, SLOW = [9.0, 1.0], [9.0, 8.0, 7.0, 6.0, 1.0]


def test_solver_that_failed_a_problem_is_not_advised() -> None:
    runs = {(p, "quick"): QUICK for p in "abcdefg"} | {("h", "quick"): []}
    slow = {(p, "slow"): SLOW for p in "abcdefgh"}
    slower = {(p, "slower"): SLOW[:1] + SLOW for p in "abcdefgh"}
    compared = comparison(runs | slow | slower)
    said = advice(compared)
    assert said[0].startswith("slow and slower each")
    assert "quick 7" in said[0]
    assert any(text.startswith("Of these, take slow:") for text in said)
    assert not any("take quick" in text for text in said)


def test_solver_that_gave_up_once_is_not_advised() -> None:
    """One gave up near the lowest cost, one found nothing where no other run ended either."""
    runs = {(p, s): SLOW for p in "abcdefgh" for s in ("slow", "slower", "early")}
    runs |= {("h", "early"): [9.0, 1.0005], ("i", "slow"): SLOW, ("i", "early"): SLOW}
    runs = {key: [9.0, *costs] if "slower" in key else costs for key, costs in runs.items()}
    early = record("h", "early", [9.0, 1.0005], claim="STALLED", optimality=1.0)
    compared = comparison(runs | {("i", "slower"): SLOW}, early=early)
    assert reliable(compared, compared.compared) == ("slow", "slower", "early")
    assert any(
        text.startswith("Of these, take slow: it needed less effort than slower on more")
        for text in advice(compared)
    )
    said = "early is not advised: in 1 of 9 runs it gave up at a point that is not stationary."
    assert said in advice(compared)
    alone = comparison(runs | {("i", "slow"): SLOW, ("i", "early"): [], ("i", "slower"): []})
    assert "i" not in alone.compared
    assert not any("take early" in text or "early has" in text for text in advice(alone))
    assert "slower is not advised: in 1 of 9 runs it raised an exception." in advice(alone)


def test_none_is_advised_when_no_solver_is_reliable() -> None:
    runs = {
        ("p", "a"): QUICK,
        ("p", "b"): [],
        ("q", "a"): [],
        ("q", "b"): QUICK,
        ("r", "a"): [],
        ("r", "b"): [],
    }
    compared = comparison(runs, known=True)
    runs_to_0 = {key: [*costs[:-1], 0.0] if costs else [] for key, costs in runs.items()}
    said = advice(comparison(runs_to_0, known=True))
    assert said == (
        "No solver returned a point within the target τ = 1e-5 from all 3 starts, so none is "
        "advised for all of these problems.",
    )
    assert reliable(compared, ("p",)) == ()  # 0 is known, and it ended at 1


@pytest.mark.parametrize("problems", ["pqrstu", "pqrst", "pq"])
def test_quicker_solver_is_named_when_chance_is_ruled_out(
    problems: str,
) -> None:
    runs = {(p, "quick"): QUICK for p in problems} | {(p, "slow"): SLOW for p in problems}
    said = advice(comparison(runs))[1]
    if len(problems) >= 6:
        assert "take quick" in said
        assert "sign test over 6 problems: p = 0.031, corrected for all pairs; level 5%" in said
    else:
        p = 2 * 0.5 ** len(problems)
        assert "may be chance" in said
        assert f"p = {p:.2g} or more" in said
        assert "With fewer than 6 problems no pair can pass this test." in said


def test_starts_of_one_problem_are_no_proof() -> None:
    starts = [f"p, start {k}" for k in range(40)]
    runs = {(p, "quick"): QUICK for p in starts} | {(p, "slow"): SLOW for p in starts}
    compared = comparison(runs)
    assert (by_effort(compared)["quick", "slow"].first, by_effort(compared)["quick", "slow"].p) == (
        40,
        1.0,
    )
    assert "may be chance" in advice(compared)[1]


def lied_to(compared: Comparison, rng: np.random.Generator) -> Comparison:
    """The same comparison as another clock would have measured it."""

    def timed(seconds: float) -> float:
        return float(seconds * rng.lognormal(sigma=3))

    records = {}
    for key, run in compared.records.items():
        trace = run.observed.trace.copy()
        trace[:, -2] = rng.random(len(trace)).cumsum()
        spent = tuple(timed(1.0) for _ in run.observed.spent)
        seen = replace(run.observed, trace=trace, spent=spent, seconds=timed(run.observed.seconds))
        records[key] = replace(run, observed=seen)
    return replace(compared, records=records)


def test_clock_does_not_rank() -> None:
    rng = np.random.default_rng(0)
    runs = {(p, s): (QUICK, SLOW)[rng.integers(2)] for p in "pqrstuvw" for s in "abcd"}
    compared = comparison(runs)
    for _ in range(20):
        other = lied_to(compared, rng)
        assert advice(other) == advice(compared)
        assert by_effort(other) == by_effort(compared)
        assert other.prices == compared.prices
        for tau in compared.taus:
            np.testing.assert_array_equal(other.needed(tau), compared.needed(tau))
            assert [other.effort(s, tau) for s in "abcd"] == [
                compared.effort(s, tau) for s in "abcd"
            ]


def test_prices_follow_their_printed_formulas() -> None:
    """One of each kind, for n = 10 unknowns, by the formulas as they are printed."""
    for k, price in enumerate(PRICES.values()):
        expected = eval(price.formula.replace("4 (", "4 * ("), {"n": 10})
        assert units(np.eye(len(PRICES))[k], 10) == expected == price.of(10)
        assert price.formula in prices_sentence()
    assert "Griewank and Walther" in prices_sentence()


def test_advice_tells_what_was_not_counted() -> None:
    runs = {(p, s): QUICK for p in "pqrstuv" for s in ("seen", "hidden", "other")}
    hidden = {f"r{p}": record(p, "hidden", QUICK, taken=True) for p in "pqrstuv"}
    compared = comparison(runs, **hidden)
    assert compared.success("hidden", 1e-5).value == 1
    assert np.isnan(compared.effort("hidden", 1e-5).value)
    assert compared.all_counted(1e-5) == ("seen", "other")
    said = advice(compared)
    assert said[0].startswith("seen, hidden and other each returned a point within the target")
    assert said[1].startswith("Of these, seen and other have the least median effort")
    assert said[2].startswith("hidden: not everything was counted in 7 of 7 runs")


def test_runs_ended_by_the_clock_are_told() -> None:
    late = record("p", "a", QUICK, claim="MAX_SECONDS")
    said = advice(comparison({("p", "a"): QUICK, ("p", "b"): QUICK}, late=late))
    assert said[-1].startswith("1 of 2 runs were ended by the clock")
