"""The page of a comparison: whole, self-contained, and of the same numbers as the table."""

import csv
import json
from pathlib import Path

import pytest

from tests.comparison.made_up import comparison
from workbench.reports import write_comparison

RUNS = {
    (p, s): costs
    for p in ("p", "<b>q: r</b>")
    for s, costs in (("good", [50.0, 1.0]), ("poor", [50.0, 5.0]), ("bad", []))
}


def test_comparison_folder_holds_page_table_and_data(tmp_path: Path) -> None:
    found = comparison(RUNS, basins={(p, "poor"): 1 for p in ("p", "<b>q: r</b>")})
    page = write_comparison(found, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "good returned a point within the target τ = 1e-5 from all 2 starts." in text
    assert "<b>q: r</b>" not in text
    assert "<summary>&lt;b&gt;q: r&lt;/b&gt;: the ends lead to" in text
    for outside in ("http://", "https://", 'src="/', "<script"):
        assert outside not in text
    assert "raised an exception" in text
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"] for row in rows[:3]] == ["REACHED", "OTHER_BASIN", "RAISED"]
    data = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert data["kind"] == "comparison"
    assert data["budget"]["max_evaluations"] == 5000
    assert data["starts"]["p"]["best"] == 1.0
    assert data["machines"] == ["a machine"]
    assert data["versions"]["numpy"]


@pytest.mark.thorough
def test_comparison_page_of_failures_and_of_one_run(tmp_path: Path) -> None:
    text = write_comparison(comparison({("p", "a"): []}), tmp_path).read_text(encoding="utf-8")
    assert "No solver returned a point within the target" in text
    alone = write_comparison(comparison({("p", "a"): [2.0]}), tmp_path).read_text(encoding="utf-8")
    assert "There is nothing to compare" in alone
    assert "Every run that can be compared reached" not in alone
    assert 'class="ending good"' not in alone
    known = comparison({("p", "a"): [0.0]}, known=True)
    text = write_comparison(known, tmp_path).read_text(encoding="utf-8")
    assert "Every run that can be compared reached the lowest cost." in text
    assert 'class="ending good"' in text
