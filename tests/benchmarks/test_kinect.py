"""Points of real scans that are held out, and the page on them."""

import json

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.kinect import PAGE, RESULTS, at_random, in_blocks, table


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
