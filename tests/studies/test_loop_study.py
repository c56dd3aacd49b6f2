"""The study of the loop of fitting and learning: its rounds, its numbers and its page."""

import json
from dataclasses import replace
from html import unescape
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from workbench.cli import loop
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.studies.fitting_loop.page import in_short, of_rounds, of_starts, write_loop
from workbench.studies.fitting_loop.study import (
    REST,
    SHIPPED,
    TRUTH,
    Errors,
    LoopPlan,
    LoopStudy,
    Round,
    loop_study,
)

PLAN = LoopPlan(
    images=6, held_out=3, rounds=2, views=30, passes=4, hidden=24, body="small", seed=42
)


@pytest.fixture(scope="module")
def found() -> LoopStudy:
    pytest.importorskip("sklearn")
    return loop_study(PLAN, None, lambda text: None)


def test_no_cost_ever_rises_and_every_set_is_whole(found: LoopStudy) -> None:
    assert [one.number for one in found.rounds] == [0, 1, 2]
    costs = [one.cost for one in found.rounds]
    assert costs == sorted(costs, reverse=True)
    for before, after in zip(found.rounds, found.rounds[1:], strict=False):
        assert (after.cost < before.cost) == (after.replaced > 0)
        changed = sum(a != b for a, b in zip(before.kept.each, after.kept.each, strict=True))
        assert changed == after.replaced
    assert {len(one.kept.each) for one in found.rounds} == {6}
    assert found.rounds[0].alone is None
    for one in found.rounds[1:]:
        assert one.alone is not None
        assert one.begun is not None
        assert len(one.alone.each) == len(one.begun.each) == 3
    assert found.best.mean < 100  # mm: a fit that begins at the truth stays near


def test_the_page_tells_the_numbers(found: LoopStudy, tmp_path: Path) -> None:
    page = write_loop(found, tmp_path / "loop")
    kept = json.loads((page.parent / "summary.json").read_text())
    assert kept["plan"]["seed"] == 42
    assert len(kept["rounds"]) == 3
    told = in_short(found)
    assert told in unescape(page.read_text())
    assert f"from {found.rounds[0].kept.mean:.0f} to {found.rounds[1].kept.mean:.0f} mm" in told
    assert f"{found.others[SHIPPED].mean:.0f} mm if the shipped regressor begins them" in told
    assert [row[3] for row in of_rounds(found).rows] == [str(one.replaced) for one in found.rounds]
    assert of_starts(found).rows[0][1].startswith(f"{found.others[REST].mean:.1f} (")


def made(first: float, last: float) -> LoopStudy:
    """A study whose held-out fits are so far off after the first and the last round."""
    errors = Errors((100.0, 200.0))
    rounds = (
        Round(0, errors, 9.0, 0, None, None),
        Round(1, Errors((90.0, 110.0)), 8.0, 2, errors, Errors((first, first))),
        Round(2, Errors((90.0, 108.0)), 7.9, 1, errors, Errors((last, last))),
    )
    others = {REST: errors, SHIPPED: Errors((70.0, 70.0)), TRUTH: Errors((60.0, 60.0))}
    return LoopStudy(replace(PLAN, images=2, held_out=2), True, rounds, others, errors, errors)


def test_the_summary_says_what_further_rounds_did() -> None:
    told = in_short(made(80.0, 75.0))
    assert "the fits above 150 mm from 1 to 0 of 2" in told
    assert (
        "Another round brings that to 99 mm, and fits to held-out images from 80 to 75 mm" in told
    )
    once = made(80.0, 75.0)
    assert "Another round" not in in_short(replace(once, rounds=once.rounds[:2]))
    assert np.isclose(once.rounds[1].kept.mean, 100)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--images", "0"], "images is a number from 1 on, not 0"),
        (["--rounds", "0"], "rounds is a number from 1 on, not 0"),
        (["--noise", "-1"], "noise is a number of px from 0 on, not -1"),
    ],
)
def test_bad_options_are_refused(arguments: list[str], told: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["loop", *arguments, "--out", str(tmp_path)])
    assert isinstance(result.exception, BadArgument)
    assert told in str(result.exception)


def test_the_command_prints_the_tables_and_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def stand_in(plan: LoopPlan, mocap: Path | None, report: object) -> LoopStudy:
        asked.append((plan, mocap))
        return made(80.0, 75.0)

    monkeypatch.setattr(loop, "loop_study", stand_in)
    arguments = ["--images", "7", "--held-out", "5", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, ["loop", *arguments])
    assert result.exit_code == 0, result.output
    assert (asked[0][0].images, asked[0][0].held_out, asked[0][1]) == (7, 5, None)
    assert "begun at the truth" in " ".join(result.output.split())
    assert (tmp_path / "loop" / "index.html").is_file()


def test_the_readme_of_studies_tells_what_the_loop_was_worth() -> None:
    top = Path(__file__).parents[2]
    known = json.loads((top / "benchmarks" / "results" / "loop.json").read_text())
    text = " ".join((top / "workbench" / "studies" / "README.md").read_text().split())
    for number, one in enumerate(known["rounds"]):
        begun = f"{one['begun']['mean']:.1f} " if one["begun"] else ""
        assert f"| {number} | {one['kept']['mean']:.1f} | {begun}|" in text
    rest, shipped, truth = (
        known["others"][f"begun {how}"]["mean"]
        for how in ("at rest", "by the shipped regressor", "at the truth")
    )
    assert f"are {rest:.1f} mm off if they begin at rest, {shipped:.1f} mm if" in text
    assert f"and {truth:.1f} mm if they begin at the truth" in text
    first, last = known["rounds"][0], known["rounds"][-1]
    gains = [
        before["kept"]["mean"] - after["kept"]["mean"]
        for before, after in pairwise(known["rounds"])
    ]
    assert max(gains) == gains[0]
    assert first["kept"]["of"] == 120
    assert last["begun"]["mean"] > shipped
