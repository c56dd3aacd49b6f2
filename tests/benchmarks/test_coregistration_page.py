"""What the page on coregistration says is what was measured."""

import json
from itertools import pairwise

import numpy as np

from benchmarks import triangle_scans
from benchmarks.coregistration import BEGIN, CONTROL, END, PAGE, RESULTS, page, share

KNOWN = json.loads(RESULTS.read_text())
ROWS = KNOWN["sets"]["holes"]
MANY = RESULTS.with_name("many-scans.json")
KINDS = ("clean", "holes", "holes and clutter")
TOGETHER, HARD = "coregistration", "coregistration, hard registrations"
BY_VERTICES, GIVEN = (
    "coregistration, templates held by vertices",
    "separate, tangential motion given",
)


def mean(name: str, what: str) -> float:
    return float(np.mean(ROWS[name][what]))


def gap(kind: str) -> float:
    """The share of the gap between the control and true meshes that is closed."""
    control, ours, best = (
        np.mean(KNOWN["sets"][kind][name]["same people"])
        for name in (CONTROL, TOGETHER, "true meshes")
    )
    return float((control - ours) / (control - best))


def test_the_page_is_written_from_the_results() -> None:
    written = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert written.strip() == page(KNOWN).strip()


def test_it_says_when_its_tables_were_made() -> None:
    text = " ".join(PAGE.read_text().split())
    for file, told in (
        (RESULTS, "finished on 26 November 2026 at {} (UTC), and at 03:19 a mistake in"),
        (MANY, "measured before that as well, at {}, and"),
        (triangle_scans.RESULTS, "the model that acts on triangles after it, at {}."),
    ):
        day, _, time = json.loads(file.read_text())["machine"]["date"].partition("T")
        assert day == "2026-11-26"
        assert told.format(time[:5]) in text


def test_vertices_are_nearer_than_in_the_control() -> None:
    text, nearer = " ".join(PAGE.read_text().split()), {}
    for what in ("hidden", "seen"):
        found = [share(KNOWN["sets"][kind], TOGETHER, CONTROL, what) for kind in KINDS]
        nearer[what] = [100 * (1 - ratio) for ratio, _, _ in found]
        assert all(0 < low < ratio < high < 1 for ratio, low, high in found)
    told = "{:.0f} % (without holes), {:.0f} % (holes) and {:.0f} % (holes and clutter) nearer"
    assert told.format(*nearer["hidden"]) in text
    assert "seen ones {:.0f} %, {:.0f} % and {:.0f} %".format(*nearer["seen"]) in text


def test_people_who_were_not_scanned_are_nearer_too() -> None:
    rows = KNOWN["sets"].values()
    gained = [row[CONTROL]["other people"] - row[TOGETHER]["other people"] for row in rows]
    told = f"it is {min(gained):.1f} to {max(gained):.1f} mm nearer"
    assert told in " ".join(PAGE.read_text().split())


def test_in_every_set_the_same_rows_are_the_worse_ones() -> None:
    for rows in KNOWN["sets"].values():
        hidden = {name: np.mean(rows[name]["hidden"]) for name in (CONTROL, HARD, BY_VERTICES)}
        assert hidden[CONTROL] < hidden[HARD] < hidden[BY_VERTICES]


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
    shares = "closes {:.0f} %, {:.0f} % and {:.0f} % of the gap"
    assert shares.format(*(100 * gap(kind) for kind in KINDS)) in " ".join(text.split())
    closed = (mean(CONTROL, "same people") - mean(TOGETHER, "same people")) / (
        mean(CONTROL, "same people") - same["true meshes"]
    )
    assert f"closes {100 * closed:.0f} % of the gap" in " ".join(text.split())


def test_what_else_was_tried_is_what_was_measured() -> None:
    text, tried = " ".join(PAGE.read_text().split()), KNOWN["tuning"]
    held, now = tried["poses held"], tried["default"]
    for what, told in (
        ("hidden", "hidden vertices from {:.2f} to {:.2f} mm"),
        ("seen", "of seen ones from {:.2f} to {:.2f}"),
        ("same people", "the same people from {:.2f} to {:.2f}"),
    ):
        assert told.format(held[what], now[what]) in text
    assert f"Hidden vertices fall to {tried['landmarks']['hidden']:.2f} mm" in text
    assert f"Hidden vertices {tried['bends of templates']['hidden']:.2f} mm" in text
    drawn = (held["hidden"], tried["poses held, two-sided"]["hidden"])
    assert "With poses held, hidden vertices go from {:.2f} to {:.2f} mm".format(*drawn) in text


def test_limbs_that_begin_again_help_separate_registrations() -> None:
    text = " ".join(PAGE.read_text().split())
    now = np.mean(KNOWN["sets"]["clean"]["separate"]["hidden"])
    before = KNOWN["limbs as they fall"]["clean"]["separate"]
    assert f"hidden vertices are {before:.1f} mm off on average" in text
    assert f"they are {now:.1f} mm off" in text


def test_what_is_said_of_many_scans_is_what_was_measured() -> None:
    text, known = " ".join(PAGE.read_text().split()), json.loads(MANY.read_text())
    assert (known["scans"], known["people"], known["kills"]) == (200, 10, 3)
    assert known["same_bits"] is True
    told = "it took {:.0f} minutes on two cores that had other work to do, {:.0f} of processor time"
    assert told.format(known["seconds"] / 60, known["cpu_seconds"] / 60) in text
    assert f"never more than {known['memory_gb']:.1f} GB" in text


def test_what_is_said_of_the_model_on_triangles_was_measured() -> None:
    known = json.loads(triangle_scans.RESULTS.read_text())
    text = PAGE.read_text()
    written = text.partition(triangle_scans.BEGIN)[2].partition(triangle_scans.END)[0]
    assert written.strip() == triangle_scans.table(known).strip()
    assert known["scans"] == 30
    hidden, seen = (
        {name: float(np.mean(rows[what])) for name, rows in known["methods"].items()}
        for what in ("hidden", "seen")
    )
    separate, control, one, *forms = hidden
    weak_alone, weak, strong_alone, strong = forms
    assert control == triangle_scans.CONTROL
    for errors in (hidden, seen):
        assert errors[weak] < errors[weak_alone] < errors[one] < errors[control]
        assert errors[control] < errors[strong_alone] < errors[strong]
    gained, lost = 1 - seen[weak] / seen[separate], hidden[weak] / hidden[separate] - 1
    told = (
        f"seen vertices are {100 * gained:.0f} % nearer and hidden ones {100 * lost:.0f} % farther"
    )
    assert told in " ".join(text.split())
