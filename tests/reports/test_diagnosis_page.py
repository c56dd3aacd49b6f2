"""A diagnosis as a folder: the page, the text and the data say the same."""

import json
from pathlib import Path
from typing import Any

import markupsafe
import pytest

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics import cases
from workbench import diagnose
from workbench.reports import refuse_foreign, write_diagnosis

NAMES = {"index.html", "diagnosis.txt", "diagnosis.json", "summary.json"}
EACH_CASE = pytest.mark.parametrize("case", cases.CASES, ids=lambda case: case.__name__)


@EACH_CASE
def test_every_known_case_has_a_page(case: Any, tmp_path: Path) -> None:
    found = diagnose(*case())
    page = write_diagnosis(found, tmp_path / "d", title=case.__name__)
    assert {path.name for path in page.parent.iterdir()} == NAMES
    html = page.read_text(encoding="utf-8")
    data = json.loads((page.parent / "diagnosis.json").read_text(encoding="utf-8"))
    assert (data["schema"], data["version"]) == ("workbench.diagnosis", 1)
    assert (page.parent / "diagnosis.txt").read_text(encoding="utf-8").startswith("FINDINGS")
    for finding in found.findings:
        assert _escaped(finding.text) in html
    for suggestion in found.suggestions:
        assert _escaped(suggestion.what) in html
    if found.here.finite:
        others = [d for d in found.null_directions if d.kind != "entry"]
        assert all(_escaped(d.name) in html for d in others)
        assert data["rank"] == found.rank
    assert "http" not in html.replace("http://www.w3.org", "")  # nothing is fetched


def test_directions_are_drawn_on_the_body(tmp_path: Path) -> None:
    problem, values = cases.joints_only()
    found = diagnose(problem, values)
    page = write_diagnosis(found, tmp_path / "d", title="joints", body=smpl_like_body())
    html = page.read_text(encoding="utf-8")
    captions = [text.split("<")[0] for text in html.split("<figcaption>")[1:]]
    assert sum("the body moved 0.5 rad along it" in text for text in captions) == 4


def test_a_comparison_is_on_the_page(tmp_path: Path) -> None:
    problem, values = cases.joints_only()
    first, second = diagnose(problem, values), diagnose(problem.freeing("pose"), values)
    page = write_diagnosis(first, tmp_path / "d", title="two", against=second)
    assert 'id="comparison"' in page.read_text(encoding="utf-8")
    data = json.loads((page.parent / "diagnosis.json").read_text(encoding="utf-8"))
    assert data["second"]["shape"] == [72, 72]
    assert "COMPARISON" in (page.parent / "diagnosis.txt").read_text(encoding="utf-8")


def test_a_second_page_takes_the_place_of_the_first(tmp_path: Path) -> None:
    found = diagnose(*cases.uneven())
    for title in ("one", "two"):
        page = write_diagnosis(found, tmp_path / "d", title=title, source="a.py")
    assert "Diagnosis of two" in page.read_text(encoding="utf-8")
    refuse_foreign(tmp_path / "d", "a.py")


def _escaped(text: str) -> str:
    return str(markupsafe.escape(text))
