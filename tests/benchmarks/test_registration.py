"""The benchmark of fits to scans: what its kept results say, and what its page says of them."""

import json

import pytest

from benchmarks import registration
from benchmarks.registration import GOOD
from workbench.registration import FIT_STAGES

KEPT = json.loads(registration.RESULTS.read_text(encoding="utf-8"))
PAGE = registration.PAGE.read_text(encoding="utf-8")
FOUR, BOTH = KEPT["scenes"]["4 views"], KEPT["scenes"]["1 view"]
ONE, FRESH = BOTH[: registration.SET], BOTH[registration.SET :]
FAILED = [run for run in ONE if run["error"] > GOOD]


def test_the_page_says_what_the_kept_results_say() -> None:
    assert f"{registration.BEGIN}\n{registration.page(KEPT)}\n{registration.END}" in PAGE
    assert [run["seed"] for run in ONE] == [run["seed"] for run in FOUR] == list(range(60))
    assert [run["seed"] for run in FRESH] == list(range(60, 120))


def test_four_views_are_enough_and_one_is_mostly() -> None:
    good = [run["error"] for run in FOUR if run["error"] <= GOOD]
    assert len(good) >= 57
    assert sum(good) / len(good) <= 7
    assert f"one view {len(FAILED)} of {len(ONE)} fits fail" in PAGE
    assert sum(bool(run["warnings"]) for run in FAILED) >= 0.8 * len(FAILED)


def test_where_one_view_fails_is_as_the_page_says() -> None:
    hidden = [run for run in FAILED if run["seen"] <= GOOD]
    assert f"In {len(hidden)} of these the vertices that were seen are right" in PAGE
    assert f"the other {len(FAILED) - len(hidden)} are wrong altogether" in PAGE
    assert all(run["hidden"] > GOOD for run in hidden)
    assert all(run["seen"] > 4 * GOOD for run in FAILED if run["seen"] > GOOD)


def test_the_seeds_that_are_new_are_told_of_as_they_are() -> None:
    failed = [run for run in FRESH if run["error"] > GOOD]
    unseen = [run for run in failed if run["seen"] <= GOOD]
    both = [run for run in BOTH if run["error"] > GOOD]
    quiet = [run["error"] for run in both if not run["warnings"]]
    page = " ".join(PAGE.split())
    assert f"{len(failed)} fail, {len(unseen)} of them only where nothing was seen" in page
    assert f"{len(BOTH) - len(both)} of all {len(BOTH)} succeed" in page
    assert f"{len(both) - len(quiet)} of the {len(both)} others are warned of" in page
    assert len(quiet) == 6  # "the six"
    assert f"are {min(quiet):.0f} to {max(quiet):.0f} mm off" in page
    long = [sum(run["CPU seconds"] > 6 for run in runs) for runs in (FOUR, BOTH)]
    assert (
        f"of these 120, on a busy machine, {long[1]} took longer; none of the 60 with four" in page
    )
    assert long[0] == 0


def test_fits_that_know_the_camera_are_told_of_as_they_are() -> None:
    """Forty-eight of sixty were aimed at, and warnings for eight of ten that fail."""
    runs = KEPT["scenes"][registration.SEEN]
    assert [run["seed"] for run in runs] == list(range(4000, 4060))
    good = [run for run in runs if run["error"] <= GOOD]
    failed = [run for run in runs if run["error"] > GOOD]
    warned = sum(bool(run["warnings"]) for run in failed)
    assert len(good) >= 48
    assert warned >= 0.8 * len(failed)
    page = " ".join(PAGE.split())
    assert f"{len(good)} of 60 succeed, and {warned} of the {len(failed)} others are warned" in page
    unseen = sum(run["seen"] <= GOOD for run in failed)
    assert f"in {unseen} of these only what was not seen is wrong" in page
    alarms = sum(bool(run["warnings"]) for run in good)
    assert f"{alarms} of those that succeed are warned of as well" in page
    long = sum(run["CPU seconds"] > 6 for run in runs)
    assert long == 0
    assert f"and {long} of the 60 took longer than 6" in page


def test_a_point_of_clutter_is_worth_what_the_page_says() -> None:
    last = FIT_STAGES[-1]
    assert last.reach / last.sigma == pytest.approx(3)
    assert f"a point of clutter is worth {3**2 / 2} units" in PAGE
    assert f"At six sigmas it\nwould be {6**2 // 2}," in PAGE


def test_shares_have_intervals_that_hold_them() -> None:
    assert "47 of 60 (66 to 88 %)" in registration.table({"1 view": ONE})
    assert "0 of 0 |" in registration.table({"4 views": FOUR})
