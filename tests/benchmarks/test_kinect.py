"""Points of real scans that are held out, and the page on them."""

import json

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.kinect import PAGE, RESULTS, at_random, in_blocks, pooled, table, table_of_pooled


def test_blocks_are_held_out_as_a_whole() -> None:
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


def test_the_page_has_the_table_of_the_results() -> None:
    runs = json.loads(RESULTS.read_text())["runs"]
    assert table(runs) in PAGE.read_text()
    assert {(run["person"], run["held out"]) for run in runs} == {
        (f"person_{letter}", way) for letter in "abc" for way in ("at random", "blocks of 5 cm")
    }


def test_the_page_tells_of_all_people_together_in_blocks() -> None:
    rows = [row for row in json.loads(RESULTS.read_text())["pooled"] if "blocks" in row["held out"]]
    assert len(rows) == 2
    assert [f"{row['model']:.1f}" for row in rows] == ["6.4", "6.8"]
    assert [f"{row['registered']:.1f}" for row in rows] == ["4.8", "4.5"]
    page = " ".join(PAGE.read_text().split())
    assert "6.4 and 6.8 mm by the model, 4.8 and 4.5 mm registered" in page


def test_all_people_together_are_their_points_and_not_the_mean_of_their_medians() -> None:
    few, many = np.array([0.001]), np.array([0.003, 0.004, 0.005, 0.006])
    people = [{"model": one, "registered": one / 2} for one in (few, many)]
    (row,) = pooled({("at random", 0): people})
    assert (row["points"], row["model"], row["registered"]) == (5, 4.0, 2.0)
    assert "| at random | 5 | 4.0 | 2.0 |" in table_of_pooled([row])
