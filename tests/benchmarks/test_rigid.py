"""The benchmark of rigid registration: that it runs, and what its kept results say."""

import json
import sys

import numpy as np
import pytest

from benchmarks import rigid

KEPT = json.loads((rigid.HERE / "results" / "rigid.json").read_text(encoding="utf-8"))["found"]


def test_without_open3d_our_rows_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)  # an import of it fails
    monkeypatch.setattr(rigid, "POINTS", 300)
    found = rigid.measure(1)
    assert [name for name in KEPT if name.startswith("ours")] == list(found)
    assert all(len(row["mm"]) == 1 for row in found.values())
    assert found["ours, distance, then Geman-McClure, the mesh"]["mm"][0] < 5
    assert rigid.table(found).count("\n") == 1 + len(found)


def test_the_page_says_what_the_kept_results_say() -> None:
    page = rigid.README.read_text(encoding="utf-8")
    assert f"{rigid.BEGIN}\n{rigid.table(KEPT)}\n{rigid.END}" in page


@pytest.mark.parametrize("error", ["degrees", "mm"])
def test_on_the_mesh_the_error_is_at_most_that_of_open3d(error: str) -> None:
    best = np.median(KEPT["ours, distance, then Geman-McClure, the mesh"][error])
    for name, row in KEPT.items():
        if name.startswith("open3d"):
            assert best <= np.median(row[error]), name
