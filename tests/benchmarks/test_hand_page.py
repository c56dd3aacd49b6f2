"""The page on hands says what its stored results say, and these are within what is claimed."""

import json

from benchmarks.hands.__main__ import BEGIN, END, PAGE, RESULTS
from benchmarks.hands.tables import tables

KINDS = ("frame", "frame with fingers")


def test_the_page_holds_the_tables_of_the_stored_results() -> None:
    text = PAGE.read_text()
    found = json.loads(RESULTS.read_text())
    assert f"{BEGIN}\n{tables(found)}\n{END}" in text


def test_what_fingers_cost_is_what_was_measured() -> None:
    seconds = json.loads(RESULTS.with_name("fingers.json").read_text())["found"]["seconds"]
    ratios = [min(seconds[k]["full-hands"]) / min(seconds[k]["full"]) for k in KINDS]
    text = " ".join(PAGE.read_text().split())
    assert f"is fitted in {ratios[0]:.2f} times the time, where at most 2.5" in text
    assert f"of body and fingers it takes {ratios[1]:.2f} times as long" in text
    assert ratios[0] < 2.5 < ratios[1]


def test_hands_are_found_as_the_page_says() -> None:
    found = json.loads(RESULTS.read_text())
    assert {what: one["rank"] for what, one in found["ranks"].items()} == {
        "16 joints": 23,
        "21 points": 38,
    }
    own = found["points"]["21 points, the body's own"]
    assert own["hands"] == own["converged"] == 100
    assert own["median"] < 2
    assert own["worst_mean"] < 6 < own["largest"]  # by hand, and by vertex
    assert own["of_them_behind_the_wrist"] > 0.5
    assert own["slowest"] < 0.1
    one = found["modelled"]
    assert max(one["model: median"]) < 2
    assert max(one["vertices free: median"]) < 2
