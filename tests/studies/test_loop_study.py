"""The study of the loop of fitting and learning: its rounds, its numbers and its page."""

import json
from html import unescape
from pathlib import Path

import pytest

from workbench.studies.fitting_loop.page import in_short, of_rounds, of_starts, write_loop
from workbench.studies.fitting_loop.study import (
    REST,
    SHIPPED,
    LoopPlan,
    LoopStudy,
    loop_study,
)

pytestmark = pytest.mark.thorough

PLAN = LoopPlan(
    images=6, held_out=3, rounds=2, views=30, passes=4, hidden=24, body="small", seed=42
)


@pytest.fixture(scope="module")
def found() -> LoopStudy:
    pytest.importorskip("sklearn")
    return loop_study(PLAN, None, lambda text: None)


def test_costs_of_rounds_never_rise(found: LoopStudy) -> None:
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


def test_page_tells_the_numbers(found: LoopStudy, tmp_path: Path) -> None:
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


def test_table_of_readme_is_the_results() -> None:
    top = Path(__file__).parents[2]
    known = json.loads((top / "benchmarks" / "results" / "loop.json").read_text())
    text = " ".join((top / "workbench" / "studies" / "README.md").read_text().split())
    for number, one in enumerate(known["rounds"]):
        begun = f"{one['begun']['mean']:.1f} " if one["begun"] else ""
        assert f"| {number} | {one['kept']['mean']:.1f} | {begun}|" in text
