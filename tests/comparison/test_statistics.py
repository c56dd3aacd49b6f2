"""Intervals: known values, limits, and what they promise on average."""

import numpy as np
import pytest

from workbench.comparison.statistics import duel, median, rate


def test_wilsons_interval_has_its_published_values() -> None:
    found = rate(15, 20)  # solves (p - 3/4)^2 = z^2 p (1 - p) / 20
    for p in (found.low, found.high):
        assert (p - 0.75) ** 2 == pytest.approx(1.959963984540054**2 * p * (1 - p) / 20)
    assert found.value == 0.75


@pytest.mark.parametrize("n", [1, 5, 100])
def test_none_and_all_have_an_open_end(n: int) -> None:
    none, all_ = rate(0, n), rate(n, n)
    assert none.low == 0
    assert 0 < none.high < 1
    assert all_.high == 1
    assert all_.low == pytest.approx(1 - none.high)
    assert rate(0, 0).low == 0
    assert rate(0, 0).high == 1


def test_wilson_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    for p in (0.1, 0.5, 0.9):
        hits = rng.binomial(30, p, 2000)
        covered = np.mean([rate(int(k), 30).low <= p <= rate(int(k), 30).high for k in hits])
        assert covered > 0.93


def test_medians_bear_infinities() -> None:
    assert median([3.0, 1.0, 2.0]).value == 2
    assert median([1.0, np.inf, np.inf]).value == np.inf
    assert median([1.0, 2.0, np.inf]).value == 2
    assert median([1.0, np.inf]).value == np.inf
    assert median([np.inf, np.inf]).low == np.inf
    assert np.isnan(median([]).value)
    one = median([4.0])
    assert one.value == 4
    assert np.isnan(one.low)  # of one number nothing is known about the spread


def test_the_bootstrap_is_seeded_and_covers() -> None:
    rng = np.random.default_rng(1)
    assert median([1, 5, 2, 8]) == median([8, 2, 5, 1])
    covered = [(found := median(rng.lognormal(size=25))).low <= 1 <= found.high for _ in range(500)]
    assert np.mean(covered) > 0.86  # 0.90 of 2,000: the percentile bootstrap is a little narrow


def test_a_duel_counts_what_only_one_solved_and_nothing_that_nobody_did() -> None:
    inf = np.inf
    found = duel([1, 5, inf, inf, 100, 2], [2, 1, inf, 7, 100.5, inf])
    assert (found.first, found.second, found.ties, found.both_fail) == (2, 2, 1, 1)
    assert not found.decided
    assert duel(np.ones(10), np.full(10, 2.0)).decided
    assert not duel([1.0], [2.0]).decided  # a single start says nothing
