"""Intervals and tests: what they promise, by exact probabilities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from tests.comparison.made_up import comparison
from workbench.comparison.statistics import (
    FEWEST,
    LEVEL,
    holm,
    median,
    paired_test,
    rate,
    sign_test,
)

EXACT = 1e-9  # of a probability: sums of binomial terms lose some 1e-15


def coverage(interval: object, n: int, p: float) -> float:
    """The exact probability that the interval of a count holds p."""
    intervals = [interval(k, n) for k in range(n + 1)]  # type: ignore[operator]
    inside = np.array([i.low <= p <= i.high for i in intervals])
    return float(binom.pmf(np.arange(n + 1), n, p)[inside].sum())


COUNTS: list[int] = [1, 3, 10]


def test_rate_interval_covers_its_level() -> None:
    for n in COUNTS:
        for p in np.linspace(0.001, 0.999, 111):
            assert coverage(rate, n, float(p)) >= 1 - LEVEL - EXACT


def test_intervals_of_none_and_all_end_at_zero_and_one() -> None:
    none, all_ = rate(0, 5), rate(5, 5)
    assert none.low == 0
    assert 0 < none.high < 1
    assert all_.high == 1
    assert all_.low == pytest.approx(1 - none.high)
    assert np.isnan(rate(0, 0).value)


def test_medians_bear_infinities_and_know_what_is_unknown() -> None:
    assert median([3.0, 1.0, 2.0]).value == 2
    assert median([1.0, np.inf, np.inf]).value == np.inf
    assert median([1.0, 2.0, np.inf]).value == 2
    assert median([1.0, np.inf]).value == np.inf
    assert median([np.inf] * 6).low == np.inf
    assert np.isnan(median([]).value)
    assert np.isnan(median([1.0, np.nan, 2.0]).value)
    assert median([4.0]).value == 4
    assert not median(np.arange(FEWEST - 1)).bounded


SIZES: list[int] = [6, 9, 20, 101]


def test_median_interval_is_the_narrowest_that_covers() -> None:
    """The median lies outside if fewer than k of n fall on one side: exact, by the binomial."""
    for n in SIZES:
        interval = median(np.arange(n) + 1.0)
        k = int(interval.low)
        assert interval.high == n + 1 - k
        assert 1 - 2 * binom.cdf(k - 1, n, 0.5) >= 0.95
        assert 1 - 2 * binom.cdf(k, n, 0.5) < 0.95  # one closer in would not


def test_sign_test_has_exact_values() -> None:
    assert sign_test(4, 0) == 0.125
    assert sign_test(0, 6) == 2 / 64
    assert sign_test(7, 1) == 2 * 9 / 256
    assert sign_test(3, 3) == 1.0
    assert sign_test(0, 0) == 1.0


PAIRS: list[int] = [4, 6, 20]


def test_pairs_of_equals_are_decided_below_the_level() -> None:
    """Of two equal solvers on n problems, exactly; at 4:0 Wilson's interval gave 12.5 %."""
    for n in PAIRS:
        alarms = sum(
            float(binom.pmf(k, n, 0.5))
            for k in range(n + 1)
            if paired_test(
                np.r_[np.ones(k), np.full(n - k, 3.0)], np.full(n, 2.0), range(n)
            ).decided
        )
        assert alarms <= LEVEL
        assert (alarms > 0) == (n >= FEWEST)


def test_holm_has_its_published_values() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5]) == [0.5]
    assert holm([]) == []
    assert holm([0.9, 0.8]) == [1.0, 1.0]


def test_paired_test_counts_what_only_one_solved() -> None:
    inf, unknown = np.inf, np.nan
    test_result = paired_test([1, 5, inf, inf, 100, 2], [2, 1, inf, 7, 100.5, inf], range(6))
    assert (test_result.first, test_result.second, test_result.ties, test_result.both_fail) == (
        2,
        2,
        1,
        1,
    )
    assert test_result.problems == (2, 2)
    assert not test_result.decided
    hidden = paired_test([unknown, unknown, 1], [3, inf, unknown], range(3))
    assert (hidden.first, hidden.second, hidden.ties) == (1, 0, 0)
    turned = replace(test_result.turned.turned, corrected=0.0)  # NaN so far, which equals nothing
    assert turned == replace(test_result, corrected=0.0)


def test_shares_of_clustered_starts_have_no_interval() -> None:
    """They are clusters: only the share of problems has one."""
    starts = {(f"{p}, start {k}", s): [1.0] for p in "pq" for k in range(3) for s in "ab"}
    compared = comparison(starts)
    assert not compared.success("a", 1e-5).bounded
    assert not compared.reached("a").bounded
    assert compared.success("a", 1e-5, "p").bounded
    assert compared.solved_problems("a", 1e-5) == rate(2, 2)
    one = comparison({(f"p, start {k}", s): [1.0] for k in range(6) for s in "ab"})
    assert one.success("a", 1e-5) == rate(6, 6)
    assert one.effort("a", 1e-5).bounded
    assert not compared.effort("a", 1e-5).bounded  # medians of two problems
