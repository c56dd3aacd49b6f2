"""What the page on coregistration says is what was measured."""

import json
from itertools import pairwise

import numpy as np

from benchmarks.coregistration import BEGIN, CONTROL, END, PAGE, RESULTS, page, share

KNOWN = json.loads(RESULTS.read_text())
ROWS = KNOWN["sets"]["holes"]
TOGETHER, HARD = "coregistration", "coregistration, hard registrations"
BY_VERTICES, GIVEN = (
    "coregistration, templates held by vertices",
    "separate, tangential motion given",
)


def mean(name: str, what: str) -> float:
    return float(np.mean(ROWS[name][what]))


def test_the_page_is_written_from_the_results() -> None:
    written = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert written.strip() == page(KNOWN).strip()


def test_hidden_vertices_are_nearer_than_in_the_control() -> None:
    ratio, low, high = share(ROWS, TOGETHER, CONTROL)
    assert ratio < 0.85
    assert 0 < low < ratio < high < 1


def test_hard_registrations_still_move_and_are_farther_off() -> None:
    costs = ROWS[HARD]["costs"]
    assert all(b <= a for a, b in pairwise(costs))
    assert costs[-1] < 0.99 * costs[-2]
    assert ROWS[TOGETHER]["costs"][-1] < 0.9 * costs[-1]
    assert mean(HARD, "hidden") > mean(CONTROL, "hidden")


def test_templates_held_by_vertices_slide() -> None:
    assert mean(BY_VERTICES, "hidden") > 2 * mean(CONTROL, "hidden")
    assert mean(TOGETHER, "tangential") > 2 * mean(TOGETHER, "normal")


def test_the_model_closes_a_share_of_the_gap() -> None:
    text = PAGE.read_text()
    same = {name: mean(name, "same people") for name in ("separate", GIVEN, "true meshes")}
    told = f"falls from {same['separate']:.2f} to {same[GIVEN]:.2f} mm"
    assert told in " ".join(text.split())
    assert f"it has {same['true meshes']:.2f} mm" in " ".join(text.split())
    closed = (mean(CONTROL, "same people") - mean(TOGETHER, "same people")) / (
        mean(CONTROL, "same people") - same["true meshes"]
    )
    assert f"closes {100 * closed:.0f} % of the gap" in " ".join(text.split())
