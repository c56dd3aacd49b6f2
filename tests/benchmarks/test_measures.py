"""What benchmarks count and compare: small cases whose answers are known."""

from typing import Any

import numpy as np
import pytest
import scipy.stats
from scipy.spatial import cKDTree

from benchmarks import history
from benchmarks.design import recorded
from benchmarks.images.intervals import WHAT, Z90, band, judged
from benchmarks.images.limbs import HIPS, NAMES, mpjpe
from benchmarks.images.video import acceleration
from benchmarks.kinect import at_random, in_blocks, pooled
from benchmarks.posterior import counted, held_out, known
from benchmarks.posterior.held_out import Seen
from benchmarks.targets import Target
from benchmarks.timing import side_by_side

MOST, LEAST = Target("a / b", 1.0, 2.0, True), Target("b / a", 1.0, 4.0, False)


def test_candidates_take_turns_on_changing_inputs() -> None:
    seen: dict[str, list[int]] = {"a": [], "b": []}
    timings = side_by_side({name: calls.append for name, calls in seen.items()}, [1, 2, 3], 2)
    assert all(set(calls) == {1, 2, 3} for calls in seen.values())
    for calls in seen.values():  # the points of the last two are remembered
        assert all(len({*some}) == 3 for some in zip(calls, calls[1:], calls[2:], strict=False))
    assert len(timings["a"]) == len(timings["b"])


def changes(*entries: tuple[str, str, dict[str, float]]) -> dict[str, tuple[float, bool]]:
    rows: list[dict[str, Any]] = [
        {"part": "fits", "date": date, "processor": processor, "ratios": ratios}
        for date, processor, ratios in entries
    ]
    return {one.name: (one.change, one.slower) for one in history.courses(rows, [MOST, LEAST])}


def test_history_calls_a_change_slower_in_both_directions() -> None:
    better, worse = {"a / b": 1.0, "b / a": 6.0}, {"a / b": 1.2, "b / a": 5.0}
    found = changes(("1", "here", better), ("2", "here", worse))
    assert found == {name: (pytest.approx(1.2), True) for name in better}
    found = changes(("1", "here", worse), ("2", "here", better))
    assert found == {name: (pytest.approx(1 / 1.2), False) for name in better}


def test_history_compares_with_the_median_on_one_processor() -> None:
    past = [(str(k), "here", {"a / b": ratio}) for k, ratio in enumerate([1.0, 1.1, 9.0])]
    elsewhere = ("4", "there", {"a / b": 0.1})
    assert changes(*past, elsewhere, ("5", "here", {"a / b": 1.1}))["a / b"] == (1.0, False)
    assert changes(*past, elsewhere)["a / b"] == (1.0, False)  # the first of its kind


def test_intervals_hold_nine_tenths_of_normal_errors() -> None:
    """Errors of exactly the stated size are held in 90 %, and offsets count in quadrature."""
    rng = np.random.default_rng(0)
    sd, lever = np.full((2000, 38), 0.3), np.full((2000, 38), 40.0)
    error = rng.normal(size=sd.shape) * np.hypot(0.3, 0.01 * 40)
    found = {"error": error, "sd": sd, "lever": lever}
    told = judged(found, 0.01)
    assert [told[name]["of"] // 2000 for name in WHAT] == [1, 1, 24, 12]
    for one in told.values():
        assert one["within"] / one["of"] == pytest.approx(0.9, abs=0.03)
        assert one["factor"] == pytest.approx(1, abs=0.05)
    assert judged(found, 0.0)["along"]["factor"] == pytest.approx(0.5 / 0.3, rel=0.05)
    assert pytest.approx(1.645, abs=1e-3) == Z90
    assert band(200) == (86, 94)
    assert told["depth"]["sd"] == pytest.approx(500)


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


@pytest.mark.parametrize(("count", "entries"), [(40, 16), (200, 16), (40, 1)])
def test_binomial_band_holds_all_entries_together(count: int, entries: int) -> None:
    low, high = counted.band(count, entries)
    chance = scipy.stats.binom(count, held_out.LEVEL)
    outside = chance.cdf(low - 1) + chance.sf(high)
    assert outside * entries <= counted.UNLIKELY
    assert (chance.cdf(low) + chance.sf(high)) * entries > counted.UNLIKELY / 2  # not too wide


def test_residuals_of_a_linear_model_imply_its_sigma() -> None:
    """40 rows, 10 of them spent."""
    rng = np.random.default_rng(0)
    J = rng.standard_normal((40, 10))
    left = np.eye(40) - J @ np.linalg.pinv(J)
    seen = [Seen(3.0 * left @ rng.standard_normal(40), 40, 10.0, np.ones(10)) for _ in range(400)]
    assert held_out.implied(seen) == pytest.approx(3.0, rel=0.03)


def test_covered_truths_are_counted_among_usable_intervals() -> None:
    def case(truth: float, usable: bool = True) -> dict[str, Any]:
        one = {"ends": [[-1.0], [1.0]], "mean": [0.0], "sd": [0.5], "usable": usable}
        laplace = one | {"usable": True}
        return {"case": f"{truth}", "truth": [truth], "emcee": one, "Laplace": laplace}

    cases = [case(0.0), case(2.0), case(-0.5), case(0.0, usable=False)]
    found = {"labels": ["x"], "sigma": 4.0, "cases": cases}
    assert counted.held(found, "emcee").tolist() == [2]
    assert counted.number(found, "emcee") == 3
    assert counted.held(found, "Laplace").tolist() == [3]
    assert counted.scores(found, "Laplace").ravel().tolist() == [0.0, 4.0, -1.0, 0.0]


def test_intervals_are_wrong_by_width_or_by_an_end() -> None:
    runs = [
        {"off": 0.1, "end": 0.1, "usable": True},
        {"off": 0.2, "end": 0.1, "usable": True},
        {"off": 0.1, "end": 0.3, "usable": True},
        {"off": 0.0, "end": 0.0, "usable": False},
    ]
    found = {"runs": 4, "right": 2, "usable": 3, "wrong": 2, "refused": 1}
    assert known.counted(runs) == found
