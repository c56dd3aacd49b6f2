"""The page on designs says what was measured, and the measurement does what it says."""

import json

import numpy as np
import pytest

from benchmarks.design import recorded, simulated
from benchmarks.design.__main__ import BEGIN, END, PAGE, RESULTS, tables

FOUND = json.loads(RESULTS.read_text())
TEXT = " ".join(PAGE.read_text().split())


def test_the_tables_are_written_from_the_numbers() -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert text.strip() == tables(FOUND).strip()


def test_predicted_standard_deviations_hold() -> None:
    rows = [one[when] for one in FOUND["compared"].values() for when in ("before", "after")]
    ratios = [row["predicted"] / row["simulated"] for row in rows]
    assert len(FOUND["compared"]) == 5
    assert all(0.9 < ratio < 1.1 for ratio in ratios)
    assert f"{min(ratios):.2f} to {max(ratios):.2f} times that of 400" in TEXT
    assert [one["fits"] for one in FOUND["compared"].values()] == [400] * 5
    assert all(row["converged"] == 400 for row in rows)
    widths = [(row["high"] - row["low"]) / (2 * 1.96 * row["simulated"]) for row in rows]
    assert f"{100 * np.mean(widths):.0f} %." in TEXT
    unknowns = [one["unknowns"] for one in FOUND["compared"].values()]
    assert sorted(unknowns)[2:] == [85] * 3


def test_the_best_camera_is_as_much_better_as_predicted() -> None:
    two = FOUND["against random"]
    factor = two["factor"]
    assert two["fits"] == 200
    ratio = factor["simulated"] / factor["predicted"]
    assert 0.8 < ratio < 1.2
    assert f"distance {factor['predicted']:.2f} times smaller than one at a random" in TEXT
    assert (
        f"each it is {factor['simulated']:.2f} times smaller ({factor['low']:.2f} to "
        f"{factor['high']:.2f}), a ratio of {ratio:.2f}" in TEXT
    )
    assert factor["low"] < factor["predicted"] < factor["high"]


def test_what_is_said_of_real_cameras_holds() -> None:
    real = FOUND["recorded"]
    same = [first for first, each in real["orders"].items() if each["predicted"] == each["error"]]
    assert same == ["cam01", "cam02", "cam03"]
    other = real["orders"]["cam04"]
    assert other["predicted"][:2] == other["error"][1::-1]
    pair = sorted(row["predicted"] for row in real["pairs"] if row["first"] == "cam04")[:2]
    assert pair[1] / pair[0] < 1.01
    low, high = real["best is best, interval"]
    assert (
        f"best in {100 * real['best is best']:.0f} % ({100 * low:.0f} to {100 * high:.0f}) of "
        f"{real['cases']} cases" in TEXT
    )
    assert low > 1 / 3
    assert f"Over {real['frames']} frames" in TEXT
    larger = [row["error"] / row["predicted"] for row in real["pairs"]]
    assert f"is {min(larger):.1f} to {max(larger):.1f} times as large as predicted" in TEXT
    told = recorded.judged(real["rows"])
    assert told["orders"] == real["orders"]
    assert told["best is best"] == pytest.approx(real["best is best"])


@pytest.mark.parametrize("name", ["a cubic", "a decay"])
def test_a_case_can_be_measured_again(name: str) -> None:
    """60 fits know a standard deviation to 9 %, and 4 of these are allowed."""
    again = simulated.compared(name, 60)
    kept = FOUND["compared"][name]
    for when in ("before", "after"):
        assert again[when]["predicted"] == pytest.approx(kept[when]["predicted"], rel=1e-3)
        ratio = again[when]["predicted"] / again[when]["simulated"]
        assert abs(ratio - 1) < 4 / np.sqrt(120)
        assert again[when]["low"] < again[when]["simulated"] < again[when]["high"]
    assert again["best"] == kept["best"]


def test_perfect_predictions_are_judged_perfect() -> None:
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
