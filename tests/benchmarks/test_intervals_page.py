"""The page says of intervals what was measured, and so does the sentence beside each interval."""

import json
import math

import numpy as np
import pytest

from benchmarks.images.intervals import (
    BEGIN,
    END,
    LEVEL,
    OFFSETS,
    PAGE,
    RESULTS,
    TUNING,
    WHAT,
    Z90,
    band,
    judged,
    share,
    tables,
)
from benchmarks.images.limbs import NAMES
from benchmarks.images.one_camera import PEOPLE, REPORTED
from tests.benchmarks.prose import Prose, unheld
from workbench.experiments.balance_video import FPS
from workbench.fitting.depth_interval import FOUND, OFFSET
from workbench.fitting.stature import MEASURED

FOUND_NUMBERS = json.loads(RESULTS.read_text())
TEXT = Prose(PAGE, "Intervals from one image")
CHOSEN = f"{1e3 * OFFSET:g}"


def kept(scene: str, offset: str, what: str) -> str:
    return share(FOUND_NUMBERS[scene][offset][what])


def factor(scene: str, what: str = "depth") -> str:
    return f"{FOUND_NUMBERS[scene][CHOSEN][what]['factor']:.2f}"


def test_the_tables_are_written_from_the_numbers() -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert text.strip() == tables(FOUND_NUMBERS).strip()


def test_the_sentence_beside_an_interval_holds() -> None:
    unknown, known = ("report, unknown", "report, known")
    assert f"that lie {100 * OFFSET:g} cm (standard deviation" in FOUND
    depth = FOUND_NUMBERS[unknown][CHOSEN]["depth"]
    assert f"on {depth['of']} images" in FOUND
    assert f"in {kept(unknown, CHOSEN, 'depth')} of the images, and" in FOUND
    assert f"and in {kept(known, CHOSEN, 'depth')} if the stature was given" in FOUND
    assert f"{factor(unknown)} and {factor(known)} times as wide would" in FOUND


def test_what_is_said_of_balance_holds() -> None:
    unknown, known = ("report, unknown", "report, known")
    none = "0"
    assert (
        f"Depth is held in {kept(unknown, none, 'depth')} of the reported frames and cameras, and "
        f"with known stature in {kept(known, none, 'depth')}, limbs along the axis in "
        f"{kept(unknown, none, 'along')} and {kept(known, none, 'along')}." in TEXT
    )
    each = [
        min(
            FOUND_NUMBERS[f"tuning, {kind}"][f"{1e3 * s:g}"]["along"]["within"]
            / FOUND_NUMBERS[f"tuning, {kind}"][f"{1e3 * s:g}"]["along"]["of"]
            for kind in ("unknown", "known")
        )
        for s in OFFSETS
    ]
    assert OFFSETS[int(np.argmax(np.array(each) >= 0.85))] == OFFSET
    least = "the smallest on the tuning frames with which limbs along the axis reach 85 %"
    assert f"With offsets of {CHOSEN} mm, {least}" in TEXT
    assert (
        f"depth is held in {kept(unknown, CHOSEN, 'depth')} and {kept(known, CHOSEN, 'depth')}, "
        f"and limbs along the axis in {kept(unknown, CHOSEN, 'along')} and "
        f"{kept(known, CHOSEN, 'along')}." in TEXT
    )
    assert f"could be {factor(unknown)} times as wide, {factor(known)} times with known" in TEXT
    worst = FOUND_NUMBERS["cameras, known"]["cam02"]
    assert "The wanted 80 % are not reached in one camera of four" in TEXT
    assert f"in cam02 with known stature it is {share(worst)}, and" in TEXT
    assert f"would have to be {worst['factor']:.2f} times as wide" in TEXT
    for kind in ("unknown", "known"):
        for name, one in FOUND_NUMBERS[f"cameras, {kind}"].items():
            assert one["within"] >= 0.8 * one["of"] or (kind, name) == ("known", "cam02")


def test_what_is_said_of_synthetic_people_holds() -> None:
    people = FOUND_NUMBERS["people"]
    low, high = band(people["the prior"]["depth"]["of"])
    for name in WHAT[:3]:
        one = people["the prior"][name]
        assert low <= 100 * one["within"] / one["of"] <= high
    assert f"limbs along the axis, with {share(people['the prior']['along'])}." in TEXT
    started = people["the prior, started at the truth"]["along"]
    assert f"at the true pose these have {share(started)}:" in TEXT
    assert f"Their {started['of']} numbers come from {PEOPLE} people" in TEXT
    assert started["of"] == 12 * PEOPLE
    assert f"they suggest {people['the prior']['noise']:.1f} px, and the noise was 5" in TEXT


def test_what_is_said_of_causes_holds() -> None:
    causes, sigmas = FOUND_NUMBERS["causes"], FOUND_NUMBERS["sigmas"]

    def bias(name: str) -> str:
        return f"{causes[name]['depth']['bias']:+.0f}"

    measured, exact = causes["as measured"], causes["the true landmarks"]
    assert f"differs** by {FOUND_NUMBERS['landmarks']:.0f} mm" in TEXT
    assert (bias("the true landmarks"), bias("without each keypoint's mean error")) == (
        "-89",
        "-92",
    )
    assert "depth stays 89 and 92 mm too small" in TEXT
    assert f"held in {share(exact['across'])} instead of {share(measured['across'])}" in TEXT
    assert f"falls from {measured['mpjpe']:.1f} to {exact['mpjpe']:.1f} mm" in TEXT
    known, both = bias("as measured, shape known"), bias("the true landmarks, shape known")
    assert f"falls from {bias('as measured')} to {known} mm, and" in TEXT
    assert f"landmarks from {bias('the true landmarks')} to {both} mm" in TEXT
    wide = bias("the true landmarks, pose prior three times as wide")
    assert f"three times as wide does not change the bias ({wide} mm)" in TEXT
    assert f"10 px of noise it is {bias('the true landmarks, 10 px of noise')} mm" in TEXT
    assert "With 10 px instead of 4 px, intervals of depth hold" in TEXT
    assert (
        f"hold {share(sigmas['10']['depth'])} of the tuning frames instead of "
        f"{share(sigmas['4']['depth'])}, but the mean error rises from {sigmas['4']['mpjpe']:.1f} "
        f"to {sigmas['10']['mpjpe']:.1f} mm" in TEXT
    )
    assert f"They suggest {FOUND_NUMBERS['noise, unknown']:.1f} px on `balance`" in TEXT
    rms = FOUND_NUMBERS["report, known"]["0"]["stature"]["rms"]
    assert f"known one by {rms:.0f} mm (root mean square)" in TEXT


def test_what_is_said_of_frames_and_numbers_is_what_the_code_has() -> None:
    apart = min(abs(a - b) for a in TUNING for b in REPORTED) / FPS
    a, b, *_, c = TUNING
    for told in (
        f"how many of the {100 * LEVEL:g} % intervals contain the truth",
        f"have to be wider to contain {100 * LEVEL:g} %",
        f"of the places of the {len(NAMES)} landmarks of the limbs",
        f"across the axis ({2 * len(NAMES)} numbers for each fit) and along it "
        f"({len(NAMES)} numbers)",
        f"*known* is a stature known to {100 * MEASURED:g} cm",
        f"With an offset of {OFFSETS[0]:g} mm the interval is Laplace's",
        f"The offset was chosen on the frames {a}, {b}, ..., {c}",
        f"Every tuning frame lies {apart:.2f} s from reported ones",
    ):
        assert told in TEXT


def test_no_number_of_its_prose_is_held_by_nothing() -> None:
    tests = (
        test_what_is_said_of_balance_holds,
        test_what_is_said_of_synthetic_people_holds,
        test_what_is_said_of_causes_holds,
        test_what_is_said_of_frames_and_numbers_is_what_the_code_has,
    )
    assert not unheld(TEXT, tests)


def test_intervals_are_judged_by_what_they_hold() -> None:
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
    assert math.isclose(told["depth"]["sd"], 500, rel_tol=1e-9)
