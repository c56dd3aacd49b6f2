"""The page on soft tissue says what was measured, and what was measured is what was promised."""

import json

from benchmarks.soft_tissue import MARK, PAGE, RESULTS, tables
from builder.soft_tissue import PEOPLE, PLAN, SEED
from workbench.motions import load_tissue

FOUND = json.loads(RESULTS.read_text())


def test_the_page_shows_the_numbers() -> None:
    assert PAGE.read_text().split(MARK)[1] == tables(FOUND)
    assert (FOUND["people"], FOUND["seeds"]) == (
        {"learned": PEOPLE, "choosing": 3, "test": 3},
        {"learned": SEED, "choosing": 100, "test": 200},
    )
    assert [line.split(",")[0] for line in FOUND["left_out"]] == ["07_12"]
    text = " ".join(PAGE.read_text().split())
    each = FOUND["as embedded"]["each"]
    for what, words in (
        ("directions_hold", f"the {PLAN.components} directions could explain"),
        ("explained", "the free run explains"),
    ):
        shares = [100 * row[what] for row in each]
        assert f"{words} {min(shares):.0f} to {max(shares):.0f} %" in text
    lowest = min(each, key=lambda row: row["explained"])
    assert lowest["rms_mm"] == min(row["rms_mm"] for row in each)
    still = FOUND["as embedded"]["inputs_that_never_move"]
    assert f"so that {len(still)} of the inputs are zero" in text
    assert {name.split(" of ")[1].split(",")[0].split("_")[1] for name in still} == {
        "foot",
        "collar",
        "hand",
    }
    found = FOUND["as embedded"]
    unknowns = found["unknowns_of_a_coefficient"]
    assert f"the rank is {found['rank']} of {unknowns}" in text
    assert found["rank"] == unknowns - len(still) - 6  # spine1 and spine2


def test_a_free_run_explains_what_was_promised() -> None:
    found = FOUND["as embedded"]
    assert found["together"]["interval_95"][0] > 0.7
    assert found["spectral_radius"] < 1
    assert abs(found["spectral_radius"] - load_tissue().spectral_radius) < 1e-4
    assert FOUND["no forces on parts"]["together"]["explained"] < 0.6
    assert found["violent_motion_mm"] < 100
