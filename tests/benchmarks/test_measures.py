"""What benchmarks count and compare: small cases whose answers are known."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.design import recorded
from benchmarks.images.limbs import HIPS, NAMES, mpjpe
from benchmarks.images.video import acceleration
from benchmarks.kinect import at_random, in_blocks, pooled
from benchmarks.posterior import known
from benchmarks.timing import side_by_side


def test_candidates_take_turns_on_changing_inputs() -> None:
    seen: dict[str, list[int]] = {"a": [], "b": []}
    timings = side_by_side({name: calls.append for name, calls in seen.items()}, [1, 2, 3], 2)
    assert all(set(calls) == {1, 2, 3} for calls in seen.values())
    for calls in seen.values():  # the points of the last two are remembered
        assert all(len({*some}) == 3 for some in zip(calls, calls[1:], calls[2:], strict=False))
    assert len(timings["a"]) == len(timings["b"])


def test_distances_of_limbs_are_taken_about_the_hips() -> None:
    true = np.random.default_rng(0).standard_normal((5, len(NAMES), 3))
    assert mpjpe(true + [1.0, 2.0, 3.0], true) == pytest.approx(0, abs=1e-9)
    moved = true.copy()
    moved[:, 0, 0] += 0.12
    assert 0 not in HIPS
    assert mpjpe(moved, true) == pytest.approx(10)
    line = np.arange(6)[:, None, None] ** 2 * np.ones((6, 12, 3)) * [1e-3, 0, 0]
    assert acceleration(line) == pytest.approx(2)


def test_blocks_of_a_scan_are_held_out_as_a_whole() -> None:
    """Half of the points either way, but in blocks the nearest fitted one is far away."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.random((20_000, 2)), np.zeros(20_000)])
    far = []
    for choose in (at_random, in_blocks):
        fitted = choose(points, 1)
        assert 0.4 < fitted.mean() < 0.6
        assert (fitted != choose(points, 2)).any()
        far.append(np.median(cKDTree(points[fitted]).query(points[~fitted])[0]))
    assert far[0] < 0.008
    assert far[1] > 0.010


def test_pooled_scans_count_points_and_not_people() -> None:
    few, many = np.array([0.001]), np.array([0.003, 0.004, 0.005, 0.006])
    people = [{"model": one, "registered": one / 2} for one in (few, many)]
    (row,) = pooled({("at random", 0): people})
    assert (row["points"], row["model"], row["registered"]) == (5, 4.0, 2.0)


def test_predictions_of_designs_are_judged_by_order() -> None:
    names = ("a", "b", "c")
    rows = [
        {"frame": t, "first": first, "second": second, "predicted": i + 1.0, "error": 10.0 * i}
        for t in range(3)
        for first in names
        for i, second in enumerate(n for n in (*names, "d") if n != first)
    ]
    told = recorded.judged(rows)
    assert told["best is best"] == told["tau"] == 1
    assert all(each["predicted"] == each["error"] for each in told["orders"].values())
    assert recorded.judged([row | {"error": -row["error"]} for row in rows])["tau"] == -1


def test_intervals_are_wrong_by_width_or_by_an_end() -> None:
    runs = [
        {"off": 0.1, "end": 0.1, "usable": True},
        {"off": 0.2, "end": 0.1, "usable": True},
        {"off": 0.1, "end": 0.3, "usable": True},
        {"off": 0.0, "end": 0.0, "usable": False},
    ]
    found = {"runs": 4, "right": 2, "usable": 3, "wrong": 2, "refused": 1}
    assert known.counted(runs) == found
