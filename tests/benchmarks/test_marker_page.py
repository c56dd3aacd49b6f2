"""The page on markers says what its stored results say."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.images.markers import RESULTS

PAGE = Path(RESULTS).parent.parent / "MARKERS.md"
COLUMNS = (
    ("shape_before", 1),
    ("offsets_before", 2),
    ("shape", 2),
    ("offsets", 2),
    ("choosing_seconds", 2),
    ("seconds", 2),
)

ON_THE_SURFACE = {  # rows of the second table, and what the page calls them
    "on the surface": "unknown",
    "on the surface, heights known": "known to 1 mm",
}


def test_the_page_holds_the_means_of_the_stored_results() -> None:
    text = PAGE.read_text()
    rows = json.loads(RESULTS.read_text())["rows"]
    assert list(rows) == ["random", "spread", "informative", *ON_THE_SURFACE]
    for stored, several in rows.items():
        name = ON_THE_SURFACE.get(stored, stored)
        means = [f"{np.mean([r[key] for r in several]):.{digits}f}" for key, digits in COLUMNS]
        assert f"| {name} | {' | '.join(means)} |" in text
        assert len(several) == 8
    met = "Both wishes are met for these markers, whether heights are known or not"
    assert met in " ".join(text.split())
    known, unknown = (
        np.mean([r["offsets"] for r in rows[stored]]) for stored in reversed(ON_THE_SURFACE)
    )
    assert known / unknown == pytest.approx(0.75, abs=0.02)  # lower by a quarter
    for stored in ON_THE_SURFACE:
        assert np.mean([r["shape"] for r in rows[stored]]) < 3
        assert np.mean([r["offsets"] for r in rows[stored]]) < 3.5
