"""The study of scans registered apart and together: its sets, its numbers and its page."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from workbench.bodies.catalogue import load_skinned
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.geometry.solids import vertex_normals
from workbench.studies.coregistration.page import in_short, table, write_together
from workbench.studies.coregistration.scans import errors, ratio, scanned_set
from workbench.studies.coregistration.study import (
    APART,
    CONTROL,
    TOGETHER,
    Cell,
    Example,
    TogetherPlan,
    TogetherStudy,
)

pytestmark = pytest.mark.thorough

PLAN = TogetherPlan(scans=(4, 8), holes=(0, 12), people=2)


def cell(scans: int, holes: int, factor: float) -> Cell:
    """A set whose errors together are a multiple of those apart."""
    rng = np.random.default_rng(scans + holes)
    apart = {what: (3 + rng.random(scans)).tolist() for what in ("hidden", "seen")}
    ours = {what: [factor * e for e in each] for what, each in apart.items()}
    subject = tuple(j % 2 for j in range(scans))
    return Cell(scans, holes, 0.3, subject, {APART: apart, CONTROL: apart, TOGETHER: ours})


def study() -> TogetherStudy:
    body = load_skinned("small")
    found = {CONTROL: body.template + 0.01, TOGETHER: body.template + 0.005}
    cells = (cell(4, 0, 1.1), cell(8, 0, 0.9), cell(4, 12, 0.8), cell(8, 12, 0.7))
    return TogetherStudy(PLAN, cells, Example(3, body.faces, body.template, found))


def test_sets_begin_with_the_scans_of_smaller_ones() -> None:
    few, more = scanned_set(5, 2, 2, holes=3), scanned_set(5, 2, 3, holes=3)
    for j in range(2):
        assert_allclose(few.scans.read(j).points, more.scans.read(j).points, atol=0)
    first = more.some(2)
    assert_allclose(first.meshes, few.meshes, atol=0)
    assert first.subject.tolist() == [0, 1]
    whole = scanned_set(5, 2, 2)
    assert whole.seen.sum() > few.seen.sum()
    moved = few.meshes.copy()
    moved[0] += 0.003 * vertex_normals(few.meshes[0], few.faces)
    found = errors(few, moved)
    assert_allclose([found[what][0] for what in ("seen", "hidden", "normal")], 3.0, rtol=1e-9)
    assert found["tangential"][0] < 1e-6
    assert found["seen"][1] == 0


def test_ratio_has_an_interval_over_people() -> None:
    subject = np.array([0, 1, 0, 1])
    assert ratio([1, 1, 1, 1], [2, 2, 2, 2], subject) == (0.5, 0.5, 0.5)
    middle, low, high = ratio([1, 3, 1, 3], [2, 2, 2, 2], subject)
    assert (middle, low, high) == (1.0, 0.5, 1.5)  # half of all draws hold both people


def test_page_tells_largest_and_least_gain(tmp_path: Path) -> None:
    s = study()
    told = in_short(s)
    assert "in 3 of 4 sets" in told
    most, least = s.cells[3], s.cells[0]
    assert f"{most.scans} scans with 12 holes in each: an error of" in told
    assert f"{most.mean(TOGETHER, 'hidden'):.1f} mm instead of" in told
    assert told.endswith(f"instead of {least.mean(CONTROL, 'hidden'):.1f}.")
    rows = table(s).rows
    assert [row[5].split()[0] for row in rows] == ["1.10", "0.90", "0.80", "0.70"]
    page = write_together(s, tmp_path / "together")
    assert told in page.read_text()
    kept = json.loads((page.parent / "summary.json").read_text())
    assert len(kept["sets"]) == 4
    assert kept["plan"]["people"] == 2
    everywhere = replace(s, cells=s.cells[1:])
    assert "in every set" in in_short(everywhere)
    assert "in no set" in in_short(replace(s, cells=s.cells[:1]))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--people", "1"], "two people or more"),
        (["--scans", "4"], "the numbers of scans rise from 6 on, not 4"),
        (["--holes", "-1"], "the numbers of holes rise from 0 on, not -1"),
        (["--workers", "0"], "--workers takes 1 or more"),
    ],
)
def test_bad_options_are_refused(arguments: list[str], told: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["together", *arguments, "--out", str(tmp_path)])
    assert result.exit_code == 2 or isinstance(result.exception, BadArgument)
    assert told in " ".join((result.output + str(result.exception)).split())


def test_table_of_readme_is_the_results() -> None:
    top = Path(__file__).parents[2]
    known = json.loads((top / "benchmarks" / "results" / "together.json").read_text())
    cells = [Cell(**one) for one in known["sets"]]
    text = " ".join((top / "workbench" / "studies" / "README.md").read_text().split())
    for one in cells:
        ratio_and_interval = "{:.2f} ({:.2f} to {:.2f})".format(*one.share("hidden"))
        errors_told = " | ".join(
            f"{one.mean(CONTROL, what):.2f} | {one.mean(TOGETHER, what):.2f}"
            + (f" | {ratio_and_interval}" if what == "hidden" else "")
            for what in ("hidden", "seen")
        )
        assert f"| {one.holes} | {one.scans} | {100 * one.unseen:.0f} % | {errors_told} |" in text
