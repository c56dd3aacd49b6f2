"""Profiles of hand-made tables, whose values are known."""

import numpy as np
import pytest

from tests.comparison.made_up import comparison
from workbench.comparison.pairs import duels
from workbench.comparison.profiles import data_profile, performance_profile, ratios

INF = np.inf
TIMES = [[1.0, 2.0, INF], [4.0, 2.0, 8.0], [INF, INF, INF], [3.0, 3.0, 6.0]]


def test_ratios_are_to_the_best_on_each_problem() -> None:
    expected = [[1, 2, INF], [2, 1, 4], [INF, INF, INF], [1, 1, 2]]
    np.testing.assert_array_equal(ratios(TIMES), expected)


def test_a_performance_profile_counts_what_is_within_alpha_of_the_best() -> None:
    found = performance_profile(TIMES, [1, 2, 4, 100])
    np.testing.assert_allclose(found[0], [0.5, 0.5, 0.0])  # a tie is a win of both
    np.testing.assert_allclose(found[1], [0.75, 0.75, 0.25])
    np.testing.assert_allclose(found[2], [0.75, 0.75, 0.5])
    np.testing.assert_allclose(found[3], [0.75, 0.75, 0.5])  # nobody solves the third


def test_a_data_profile_counts_simplex_gradients() -> None:
    found = data_profile(TIMES, [0, 1, 1, 2], [1, 2, 4])  # divided by 1, 2, 2, 3
    np.testing.assert_allclose(found[0], [0.5, 0.5, 0.0])
    np.testing.assert_allclose(found[1], [0.75, 0.75, 0.25])
    np.testing.assert_allclose(found[2], [0.75, 0.75, 0.5])


def test_nobody_and_nothing() -> None:
    np.testing.assert_array_equal(performance_profile([[INF], [INF]], [1, 10]), 0)
    assert performance_profile(np.zeros((0, 2)), [1.0]).shape == (1, 2)
    np.testing.assert_array_equal(performance_profile([[5.0], [7.0]], [1.0]), 1)  # one solver


def test_the_share_never_falls_and_ends_at_the_rate_of_success() -> None:
    rng = np.random.default_rng(0)
    times = rng.lognormal(size=(50, 4))
    times[rng.random((50, 4)) < 0.3] = INF
    for found in (
        performance_profile(times, np.geomspace(1, 1e6, 99)),
        data_profile(times, rng.integers(1, 9, 50), np.geomspace(1e-3, 1e6, 99)),
    ):
        assert (np.diff(found, axis=0) >= 0).all()
        np.testing.assert_allclose(found[-1], np.isfinite(times).mean(axis=0))


def test_taking_a_solver_out_can_turn_two_others_round() -> None:
    """Gould and Scott's reason not to rank more than two by one profile."""
    times = np.array([[2.0, 3.0, 1.0], [2.0, 3.0, 1.0], [3.0, 1.2, 1.0]])
    alone = performance_profile(times[:, :2], [2.0])[0]
    together = performance_profile(times, [2.0])[0]
    assert alone[0] == pytest.approx(2 / 3)
    assert alone[1] == pytest.approx(1.0)
    assert together[0] > together[1]


def test_effort_of_a_comparison_is_read_from_its_traces() -> None:
    found = comparison(
        {
            ("p", "a"): [50.0, 9.0, 0.0],
            ("p", "b"): [100.0, 10.0, 0.0],
            ("q", "a"): [100.0],
            ("q", "b"): [5.0, 0.0],
        }
    )
    np.testing.assert_array_equal(found.needed(0.1), [[2, 2], [INF, 1]])
    np.testing.assert_array_equal(found.needed(1e-3), [[3, 3], [INF, 2]])
    duel = duels(found, 1e-3)["a", "b"]
    assert (duel.first, duel.second, duel.ties, duel.both_fail) == (0, 1, 1, 0)
